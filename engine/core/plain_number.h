// Numbers in messages: digits alone, without an exponent.
#pragma once

#include <string>

namespace terrace {

// So many significant digits, but all of those before the point, and no zeros at the end: with six digits
// "0.000277778", "12.5", "1234567".
std::string PlainNumber(double value, int digits = 6);

// The same, never below `value`: for bounds that have to hold as they are printed.
std::string PlainNumberUp(double value, int digits);

}  // namespace terrace
