#include "proto/format_error_up.h"

#include <fmt/format.h>

#include <charconv>

namespace terrace::proto {

std::string FormatErrorUp(double error_m) {
  std::string text = fmt::format("{:.6g}", error_m);
  double printed = 0;
  std::from_chars(text.data(), text.data() + text.size(), printed);
  if (printed >= error_m) return text;
  // The text was rounded down by less than half a unit of the last digit, so adding one unit gives the next number. The
  // unit is parsed from text, because powers of ten of the C library may differ between processors.
  const std::string digits = fmt::format("{:.5e}", error_m);
  int exponent = 0;
  const std::size_t mark = digits.find('e') + 1, sign = digits[mark] == '+' ? 1 : 0;
  std::from_chars(digits.data() + mark + sign, digits.data() + digits.size(), exponent);
  const std::string one = fmt::format("1e{}", exponent - 5);
  double unit = 0;
  std::from_chars(one.data(), one.data() + one.size(), unit);
  return fmt::format("{:.6g}", error_m + unit);
}

}  // namespace terrace::proto
