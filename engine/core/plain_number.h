// Numbers in messages: only digits, no exponent.
#pragma once

#include <cstdint>
#include <string>

namespace terrace {

// Writes `digits` significant digits, but never fewer than the integer part has, and no trailing zeros: with six digits
// "0.000277778", "12.5", "1234567".
std::string PlainNumber(double value, int digits = 6);

// Like PlainNumber, but rounds up: a printed bound still holds.
std::string PlainNumberUp(double value, int digits);

// "1,234,567"
std::string Grouped(std::uint64_t number);

}  // namespace terrace
