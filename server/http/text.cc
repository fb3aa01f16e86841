#include "server/http/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "engine/core/parse_number.h"

namespace terrace::server {

std::string_view Trim(std::string_view text, std::string_view blanks) {
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::optional<std::string_view> AfterScheme(std::string_view text) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (EqualsIgnoringCase(text.substr(0, scheme.size()), scheme)) return text.substr(scheme.size());
  }
  return std::nullopt;
}

std::string_view NextPiece(std::string_view& rest, char separator, std::string_view blanks) {
  const std::size_t end = std::min(rest.find(separator), rest.size());
  const std::string_view piece = Trim(rest.substr(0, end), blanks);
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return piece;
}

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<double> FiniteNumber(std::string_view text) {
  const auto value = ParseNumber<double>(text);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<double> PositiveNumber(std::string_view text) {
  const std::optional<double> value = FiniteNumber(text);
  return value && *value > 0 ? value : std::nullopt;
}

std::optional<std::int64_t> PlainDecimal(std::string_view text, std::size_t max_digits) {
  if (text.empty() || text.size() > max_digits || (text.size() > 1 && text[0] == '0')) return std::nullopt;
  std::int64_t number = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return std::nullopt;
    number = number * 10 + (c - '0');
  }
  return number;
}

std::optional<std::string> PercentDecode(std::string_view text) {
  std::string decoded;
  decoded.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    if (text.size() - i < 3) return std::nullopt;
    const int high = HexDigit(text[i + 1]), low = HexDigit(text[i + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    const int byte = high * 16 + low;
    if (byte < 0x20 || byte == 0x7f) return std::nullopt;
    decoded += static_cast<char>(byte);
    i += 2;
  }
  return decoded;
}

std::string PercentEncode(std::string_view text) {
  constexpr std::string_view kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
  std::string encoded;
  for (const char c : text) {
    if (kPlain.find(c) != std::string_view::npos) {
      encoded += c;
    } else {
      fmt::format_to(std::back_inserter(encoded), "%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return encoded;
}

Result<QueryParameters> ParseQuery(std::string_view query) {
  QueryParameters parameters;
  while (!query.empty()) {
    const std::string_view piece = NextPiece(query, '&', "");
    if (piece.empty()) continue;
    const std::size_t equals = std::min(piece.find('='), piece.size());
    const std::string_view name = piece.substr(0, equals);
    if (name.find('%') != std::string_view::npos) {
      return MakeError(ErrorCode::kInvalidArgument, "a parameter's name has a percent sign; write it plainly");
    }
    std::optional<std::string> value = PercentDecode(piece.substr(std::min(equals + 1, piece.size())));
    if (!value) return MakeError(ErrorCode::kInvalidArgument, "malformed percent-encoding of a parameter");
    parameters.emplace_back(name, *std::move(value));
  }
  return parameters;
}

Result<void> ReadParameters(std::string_view query, std::span<const char* const> names,
                            const std::function<Result<void>(std::size_t, const std::string&)>& set,
                            std::string_view known, bool takes_version) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  std::vector<bool> given(names.size());
  for (const auto& [name, value] : *sent) {
    if (takes_version && name == "v") continue;
    const auto i = static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
    if (i == names.size()) {
      return MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are {}",
                       known.empty() ? fmt::format("{}", fmt::join(names, ", ")) : std::string(known));
    }
    if (given[i]) return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", name);
    given[i] = true;
    if (Result<void> done = set(i, value); !done) return done;
  }
  return {};
}

Result<void> RefuseParameters(std::string_view query) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  for (const auto& [name, value] : *sent) {
    if (name != "v") return MakeError(ErrorCode::kInvalidArgument, "this URL takes no parameters");
  }
  return {};
}

}  // namespace terrace::server
