#include "config/options/option_codec.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace terrace::config {
namespace {

struct ByteUnit {
  std::string_view name;
  std::int64_t bytes;
};
constexpr std::array<ByteUnit, 11> kByteUnits = {{{"", 1},
                                                  {"B", 1},
                                                  {"kB", 1'000},
                                                  {"KB", 1'000},
                                                  {"MB", 1'000'000},
                                                  {"GB", 1'000'000'000},
                                                  {"TB", 1'000'000'000'000},
                                                  {"KiB", std::int64_t{1} << 10},
                                                  {"MiB", std::int64_t{1} << 20},
                                                  {"GiB", std::int64_t{1} << 30},
                                                  {"TiB", std::int64_t{1} << 40}}};

constexpr std::int64_t kLargestExact = std::int64_t{1} << 53;

}  // namespace

Json NumberToJson(const std::string& text) {
  Json number = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  return number.is_number() ? number : Json(text);
}

Json SwitchToJson(const std::string& text) {
  if (text == "true") return true;
  if (text == "false") return false;
  return text;
}

Json TextsToJson(const std::string& text) {
  Json list = Json::array();
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t comma = std::min(text.find(',', start), text.size());
    list.push_back(text.substr(start, comma - start));
    start = comma + 1;
  }
  return list;
}

std::string CheckOneLine(const std::string& text) {
  return HasControlCharacter(text) ? "must be text on one line" : "";
}

std::optional<std::int64_t> WholeNumber(const Json& value) {
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  if (std::abs(number) > static_cast<double>(kLargestExact) || number != std::floor(number)) return std::nullopt;
  return static_cast<std::int64_t>(number);
}

std::optional<std::int64_t> ByteCount(const Json& value) {
  if (!value.is_string()) return WholeNumber(value);
  const std::string& text = value.get_ref<const std::string&>();
  const std::size_t digits_end = std::min(text.find_first_not_of("0123456789."), text.size());
  const Json number = NumberToJson(text.substr(0, digits_end));
  if (!number.is_number()) return std::nullopt;
  const std::size_t unit_start = std::min(text.find_first_not_of(' ', digits_end), text.size());
  for (const ByteUnit& unit : kByteUnits) {
    if (std::string_view(text).substr(unit_start) != unit.name) continue;
    const double bytes = std::floor(number.get<double>() * static_cast<double>(unit.bytes));
    if (bytes <= static_cast<double>(kLargestExact)) return static_cast<std::int64_t>(bytes);
  }
  return std::nullopt;
}

Json NumberOut(double value) {
  const std::optional<std::int64_t> whole = WholeNumber(value);
  return whole ? Json(*whole) : Json(value);
}

}  // namespace terrace::config
