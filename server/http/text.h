// Small parsers for the text in requests. ASCII only, independent of the locale.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/core/ascii.h"
#include "engine/core/names.h"
#include "engine/core/nearest_name.h"
#include "engine/core/result.h"

namespace terrace::server {

// Removes `blanks` from both ends.
std::string_view Trim(std::string_view text, std::string_view blanks = " \t");

// Returns the text after "http://" or "https://", in upper or lower case; nothing if the text begins with neither.
std::optional<std::string_view> AfterScheme(std::string_view text);

// Removes from `rest` the piece before the next `separator`, and the separator. Returns the piece, trimmed of `blanks`.
std::string_view NextPiece(std::string_view& rest, char separator, std::string_view blanks = " \t");

// 0 to 15, or -1.
int HexDigit(char c);

// The whole text as a finite number. Nothing if the number overflows or underflows a double.
std::optional<double> FiniteNumber(std::string_view text);
std::optional<double> PositiveNumber(std::string_view text);

// Finite numbers with commas between them, each trimmed of `blanks`; nothing if the text is anything else.
template <std::size_t kCount>
std::optional<std::array<double, kCount>> NumbersOf(std::string_view text, std::string_view blanks = "") {
  std::array<double, kCount> numbers{};
  for (std::size_t i = 0; i < kCount; ++i) {
    const bool is_last = i + 1 == kCount;
    if (!is_last && text.find(',') == std::string_view::npos) return std::nullopt;
    const auto number = FiniteNumber(is_last ? Trim(text, blanks) : NextPiece(text, ',', blanks));
    if (!number) return std::nullopt;
    numbers[i] = *number;
  }
  return numbers;
}

// A plain decimal number without sign and leading zeros, of 1 to `max_digits` (at most 18) digits. Every number has
// exactly one text.
std::optional<std::int64_t> PlainDecimal(std::string_view text, std::size_t max_digits);

// Decodes percent-encoding once. Nothing if a '%' is not followed by two hexadecimal digits or encodes a control
// character. '+' stays '+'.
std::optional<std::string> PercentDecode(std::string_view text);

// Encodes a text as one path segment of a URL.
std::string PercentEncode(std::string_view text);

// Names and decoded values in the order sent. A piece without '=' has an empty value; empty pieces are skipped.
using QueryParameters = std::vector<std::pair<std::string, std::string>>;

// Parses the query of a URL. kInvalidArgument: percent-encoding in a value is malformed or encodes a control character,
// or a name contains '%': no name here needs it, and proxies would not recognize the parameter.
Result<QueryParameters> ParseQuery(std::string_view query);

// Reads a query. Calls `set` with the index of each name in `names` and the value, in the order sent. `takes_version`:
// the URL may have `v`, which is ignored. kInvalidArgument: as ParseQuery; a name is given twice; a name is not one of
// `names`. `known`: the names that the message about an unknown name lists; empty: all `names`. Errors of `set` are
// returned.
Result<void> ReadParameters(std::string_view query, std::span<const char* const> names,
                            const std::function<Result<void>(std::size_t, const std::string&)>& set,
                            std::string_view known = {}, bool takes_version = true);

// Sets `to` to the value that the word `text` has in `words`. kInvalidArgument: another text; the message is "size must
// be 256 or 512" for the parameter `name` "size".
template <typename T, std::size_t kCount>
Result<void> SetOneOf(T& to, std::string_view name, std::string_view text, const Names<T, kCount>& words) {
  if (const std::optional<T> meaning = ValueNamed(words, text)) {
    to = *meaning;
    return {};
  }
  std::vector<std::string> allowed;
  for (const auto& [word, meaning] : words) allowed.emplace_back(word);
  return MakeError(ErrorCode::kInvalidArgument, "{} must be {}", name, Alternatives(allowed));
}
template <typename T, std::size_t kCount>
Result<void> SetOneOf(T& to, std::string_view name, std::string_view text,
                      const std::pair<std::string_view, std::type_identity_t<T>> (&words)[kCount]) {
  return SetOneOf(to, name, text, std::to_array(words));
}

// For URLs that have no parameters except `v`.
Result<void> RefuseParameters(std::string_view query);

}  // namespace terrace::server
