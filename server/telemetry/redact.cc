#include "server/telemetry/redact.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

#include "config/common/token_hash.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

constexpr std::string_view kLeftOut = "...";
constexpr std::string_view kVersion = "v";    // has any value
constexpr std::string_view kCrs = "crs";      // the code of an authority
constexpr std::string_view kToken = "token";  // omitted and not counted: admission removes it from requests

// The parameters of all URLs; a test compares them with the manual.
constexpr std::string_view kParameters[] = {
    "error",   "fraction",  "atleast", "extensions", "compression", "texture", "encoding",   "size",     "v",
    "path",    "locations", "step",    "samples",    "datum",       "certify", "bbox",       "format",   "coordinates",
    "normals", "surface",   "level",   "width",      "height",      "spacing", "azimuth",    "altitude", "zfactor",
    "style",   "interval",  "crs",     "range",      "from",        "to",      "refraction", "heights",  "rays"};

// Values of parameters that are not numbers; several are separated by '-'.
constexpr std::string_view kWords[] = {"octvertexnormals",
                                       "watermask",
                                       "metadata",
                                       "draco",
                                       "none",
                                       "quantized",
                                       "meshopt",
                                       "jpeg",
                                       "webp",
                                       "mapbox",
                                       "terrarium",
                                       "ellipsoid",
                                       "orthometric",
                                       "deepest",
                                       "glb",
                                       "obj",
                                       "ply",
                                       "enu",
                                       "ecef",
                                       "geographic",
                                       "source",
                                       "served",
                                       "ground",
                                       "f32",
                                       "r16",
                                       "png16",
                                       "geotiff",
                                       "json",
                                       "png",
                                       "jpg",
                                       "colors",
                                       "degrees",
                                       "terrain"};

using Characters = std::array<bool, 256>;

constexpr Characters Among(std::string_view characters) {
  Characters among{};
  for (const char c : characters) among[static_cast<unsigned char>(c)] = true;
  return among;
}

constexpr Characters kOfPath = Among("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~/");
constexpr Characters kOfHost = Among("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-.:[]");
constexpr Characters kOfNumbers = Among("0123456789.,|eE+-");
constexpr Characters kDigits = Among("0123456789");
constexpr std::size_t kMaxCrsDigits = 6;

std::size_t PlainPrefix(std::string_view text, const Characters& plain) {
  std::size_t size = 0;
  while (size < text.size() && plain[static_cast<unsigned char>(text[size])]) ++size;
  return size;
}

bool IsAmong(std::string_view text, const auto& texts) {
  return std::find(std::begin(texts), std::end(texts), text) != std::end(texts);
}

// The commas, bars and blanks between them may be encoded.
bool AreNumbers(std::string_view text) {
  for (;;) {
    text.remove_prefix(PlainPrefix(text, kOfNumbers));
    if (text.empty()) return true;
    const std::string_view encoded = text.substr(0, 3);
    if (!EqualsIgnoringCase(encoded, "%2c") && !EqualsIgnoringCase(encoded, "%7c") && encoded != "%20") return false;
    text.remove_prefix(encoded.size());
  }
}

// "EPSG:" and digits; the colon may be encoded.
bool IsCrs(std::string_view text) {
  for (const std::string_view authority : {"epsg:", "epsg%3a"}) {
    if (!EqualsIgnoringCase(text.substr(0, authority.size()), authority)) continue;
    text.remove_prefix(authority.size());
    return text.size() <= kMaxCrsDigits && PlainPrefix(text, kDigits) == text.size();
  }
  return false;
}

bool AreWords(std::string_view text) {
  while (!text.empty()) {
    if (!IsAmong(NextPiece(text, '-', /*blanks=*/""), kWords)) return false;
  }
  return true;
}

// "name=value" of a query, or a name alone.
struct Parameter {
  explicit Parameter(std::string_view piece)
      : name(piece.substr(0, piece.find('='))), value(piece.substr(std::min(name.size() + 1, piece.size()))) {}

  bool is_plain() const {
    if (name == kVersion) return PlainPrefix(value, kOfPath) == value.size();
    if (name == kCrs && IsCrs(value)) return true;
    return IsAmong(name, kParameters) && (AreNumbers(value) || AreWords(value));
  }

  std::string_view name, value;
};

// The path of a target: after its scheme and host, if any, and before its query.
struct Parts {
  explicit Parts(std::string_view target) {
    const std::size_t question = std::min(target.find('?'), target.size());
    path = target.substr(0, question);
    query = target.substr(std::min(question + 1, target.size()));
    if (const std::optional<std::string_view> rest = AfterScheme(path)) {
      path = rest->substr(std::min(rest->find('/'), rest->size()));
    }
    is_path = path.empty() || path.starts_with('/') || path == "*";  // of OPTIONS
  }

  std::string_view path, query;
  bool is_path;
};

std::string ShownPath(std::string_view path, bool is_known) {
  const std::string_view plain = path.substr(0, PlainPrefix(path, kOfPath));
  std::string shown;
  for (std::size_t at = 0; at < plain.size();) {
    const std::size_t slash = std::min(plain.find('/', at), plain.size());
    const std::string_view segment = plain.substr(at, slash - at);
    shown += is_known || segment.size() < config::kMinTokenBytes ? segment : kLeftOut;
    if (slash < plain.size()) shown += '/';
    at = slash + 1;
  }
  if (plain.size() < path.size() && !shown.ends_with(kLeftOut)) shown += kLeftOut;
  return shown;
}

}  // namespace

bool IsPlainTarget(std::string_view target) {
  if (!target.starts_with('/')) return false;
  const std::size_t path = PlainPrefix(target, kOfPath);
  if (path == target.size()) return true;
  if (target[path] != '?') return false;
  Parts parts(target);
  while (!parts.query.empty()) {
    const std::string_view piece = NextPiece(parts.query, '&', /*blanks=*/"");
    if (!piece.empty() && !Parameter(piece).is_plain()) return false;
  }
  return true;
}

std::string RedactTarget(std::string_view target, bool is_known) {
  Parts parts(target);
  if (!parts.is_path) return std::string(kLeftOut);
  std::string shown = parts.path == "*" ? "*" : ShownPath(parts.path, is_known);
  char before = '?';
  std::size_t left_out = 0;
  while (!parts.query.empty()) {
    const std::string_view piece = NextPiece(parts.query, '&', /*blanks=*/"");
    if (piece.empty()) continue;
    const Parameter parameter(piece);
    if (parameter.name == kToken) continue;
    if (!parameter.is_plain()) {
      ++left_out;
      continue;
    }
    shown += std::exchange(before, '&');
    shown += parameter.name == kVersion ? kVersion : piece;
  }
  if (left_out > 0) shown += fmt::format("{}+{}", before, left_out);
  return shown;
}

std::string RedactReferer(std::string_view referer) {
  const std::optional<std::string_view> rest = AfterScheme(referer);
  if (!rest) return {};
  const std::string_view scheme = referer.substr(0, referer.size() - rest->size());
  std::string_view host = rest->substr(0, rest->find_first_of("/?#"));
  const std::string_view path = rest->substr(host.size());
  if (const std::size_t at = host.rfind('@'); at != std::string_view::npos) host.remove_prefix(at + 1);
  if (PlainPrefix(host, kOfHost) < host.size()) return {};
  return std::string(scheme) + std::string(host) + ShownPath(path.substr(0, path.find_first_of("?#")), false);
}

}  // namespace terrace::server
