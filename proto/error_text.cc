#include "proto/error_text.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace terrace::proto {

std::string FormatErrorUp(double error_m) {
  std::string text = fmt::format("{:.6g}", error_m);
  double printed = 0;
  std::from_chars(text.data(), text.data() + text.size(), printed);
  if (printed >= error_m) return text;
  // Rounding went down by less than half a unit of the last digit: one unit more rounds to the next number up.
  const double unit = std::pow(10.0, std::floor(std::log10(error_m)) - 5);
  return fmt::format("{:.6g}", error_m + unit);
}

}  // namespace terrace::proto
