// Numbers in texts, independent of the locale.
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace terrace {

// The number that the whole text is. Nothing: the text is empty, has other characters, such as blanks or '+', or the
// number does not fit into the type. `format`: the base of an integer, or a std::chars_format. "inf" and
// "nan" are numbers of a floating-point type.
template <typename Number, typename... Format>
std::optional<Number> ParseNumber(std::string_view text, Format... format) {
  Number number{};
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number, format...);
  if (error != std::errc() || end != last) return std::nullopt;
  return number;
}

}  // namespace terrace
