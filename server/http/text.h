// Small parsers for the text in requests. ASCII only, independent of the locale.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

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

}  // namespace terrace::server
