#include "engine/core/plain_number.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace terrace {
namespace {

int DecimalsFor(double value, int digits) {
  if (value == 0 || !std::isfinite(value)) return 0;
  const int exponent = static_cast<int>(std::floor(std::log10(std::abs(value))));
  return std::max(digits - 1 - exponent, 0);
}

std::string WithDecimals(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text == "-0" ? "0" : text;
}

}  // namespace

std::string PlainNumber(double value, int digits) { return WithDecimals(value, DecimalsFor(value, digits)); }

std::string PlainNumberUp(double value, int digits) {
  const int decimals = DecimalsFor(value, digits);
  const std::string text = WithDecimals(value, decimals);
  double printed = 0;
  std::from_chars(text.data(), text.data() + text.size(), printed);  // strtod depends on the program's locale
  return printed < value ? WithDecimals(printed + std::pow(10.0, -decimals), decimals) : text;
}

std::string Grouped(std::uint64_t number) {
  std::string digits = std::to_string(number);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), 1, ',');
  }
  return digits;
}

}  // namespace terrace
