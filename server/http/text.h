// Small parsers for the text in requests. ASCII only, independent of the locale.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"

namespace terrace::server {

// Removes `blanks` from both ends.
std::string_view Trim(std::string_view text, std::string_view blanks = " \t");

std::string Lower(std::string_view text);
bool EqualsIgnoringCase(std::string_view a, std::string_view b);

// Returns the text after "http://" or "https://", in upper or lower case; nothing if the text begins with neither.
std::optional<std::string_view> AfterScheme(std::string_view text);

// Removes from `rest` the piece before the next `separator`, and the separator. Returns the piece, trimmed of `blanks`.
std::string_view NextPiece(std::string_view& rest, char separator, std::string_view blanks = " \t");

// 0 to 15, or -1.
int HexDigit(char c);

// The whole text as a finite number. Nothing if the number overflows or underflows a double.
std::optional<double> FiniteNumber(std::string_view text);
std::optional<double> PositiveNumber(std::string_view text);

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

// For URLs that have no parameters except `v`.
Result<void> RefuseParameters(std::string_view query);

}  // namespace terrace::server
