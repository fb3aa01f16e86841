#include "proto/media_type.h"

#include <algorithm>
#include <optional>

namespace terrace::proto {
namespace {

char Lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool EqualsIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) { return Lower(x) == Lower(y); });
}

std::string_view Trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// Takes what stands before the first `separator` outside of double quotes off `rest`.
std::string_view TakePart(std::string_view& rest, char separator) {
  bool quoted = false;
  std::size_t at = 0;
  for (; at < rest.size(); ++at) {
    if (rest[at] == '"') quoted = !quoted;
    if (rest[at] == separator && !quoted) break;
  }
  const std::string_view part = rest.substr(0, at);
  rest.remove_prefix(std::min(at + 1, rest.size()));
  return Trimmed(part);
}

struct Parameter {
  std::string_view name, value;
};

Parameter ParseParameter(std::string_view text) {
  const std::string_view name = TakePart(text, '=');
  std::string_view value = Trimmed(text);
  if (value.size() >= 2 && value.front() == '"' && value.back() == '"') value = value.substr(1, value.size() - 2);
  return {name, value};
}

// RFC 9110 section 12.4.2, in thousandths: "1", "0.5", "0.333". What is not a weight counts as zero.
int ParseWeight(std::string_view text) {
  if (text.empty() || text.size() > 5 || (text[0] != '0' && text[0] != '1')) return 0;
  if (text.size() > 1 && text[1] != '.') return 0;
  int weight = text[0] == '1' ? 1000 : 0;
  int unit = 100;
  for (std::size_t i = 2; i < text.size(); ++i, unit /= 10) {
    if (text[i] < '0' || text[i] > '9') return 0;
    weight += (text[i] - '0') * unit;
  }
  return weight <= 1000 ? weight : 0;
}

struct Weights {
  std::optional<int> gzip, identity, any;
};

Weights ParseCodings(std::string_view accept_encoding) {
  Weights weights;
  while (!accept_encoding.empty()) {
    std::string_view element = TakePart(accept_encoding, ',');
    const std::string_view coding = TakePart(element, ';');
    int weight = 1000;
    while (!element.empty()) {
      const Parameter parameter = ParseParameter(TakePart(element, ';'));
      if (EqualsIgnoringCase(parameter.name, "q")) weight = ParseWeight(parameter.value);
    }
    if (EqualsIgnoringCase(coding, "gzip") || EqualsIgnoringCase(coding, "x-gzip")) weights.gzip = weight;
    if (EqualsIgnoringCase(coding, "identity")) weights.identity = weight;
    if (coding == "*") weights.any = weight;
  }
  return weights;
}

}  // namespace

TileExtensions ParseExtensions(std::string_view names) {
  TileExtensions extensions;
  while (!names.empty()) {
    const std::string_view name = TakePart(names, '-');
    if (EqualsIgnoringCase(name, "octvertexnormals")) extensions.octvertexnormals = true;
    if (EqualsIgnoringCase(name, "watermask")) extensions.watermask = true;
    if (EqualsIgnoringCase(name, "metadata")) extensions.metadata = true;
  }
  return extensions;
}

TileExtensions ExtensionsInAccept(std::string_view accept) {
  TileExtensions extensions;
  while (!accept.empty()) {
    std::string_view range = TakePart(accept, ',');
    TakePart(range, ';');  // the media type itself
    while (!range.empty()) {
      const Parameter parameter = ParseParameter(TakePart(range, ';'));
      if (EqualsIgnoringCase(parameter.name, "extensions")) extensions = extensions | ParseExtensions(parameter.value);
    }
  }
  return extensions;
}

std::string_view QuantizedMeshContentType(TileExtensions extensions) {
  // By bits: normals 1, water mask 2, metadata 4.
  static constexpr std::string_view kTypes[] = {
      "application/vnd.quantized-mesh",
      "application/vnd.quantized-mesh;extensions=octvertexnormals",
      "application/vnd.quantized-mesh;extensions=watermask",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask",
      "application/vnd.quantized-mesh;extensions=metadata",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-metadata",
      "application/vnd.quantized-mesh;extensions=watermask-metadata",
      "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata",
  };
  return kTypes[(extensions.octvertexnormals ? 1 : 0) + (extensions.watermask ? 2 : 0) + (extensions.metadata ? 4 : 0)];
}

ContentCoding ChooseCoding(std::string_view accept_encoding) {
  const Weights weights = ParseCodings(accept_encoding);
  const int gzip = weights.gzip.value_or(weights.any.value_or(0));
  // Unmentioned, identity is acceptable but wanted by nobody.
  const int identity = weights.identity.value_or(weights.any.value_or(0));
  return gzip > 0 && gzip >= identity ? ContentCoding::kGzip : ContentCoding::kIdentity;
}

}  // namespace terrace::proto
