// The check of an option's number.
#pragma once

#include <functional>
#include <string>

namespace terrace::cli {

// For CLI::Option::check. Refuses what is no T from `min` to `max`, NaN too, which CLI::Range accepts. The message
// follows the name of the option; `what`: "a number from 0 to 1". The check adds nothing to the help. T: int, unsigned
// or double.
template <typename T>
std::function<std::string(const std::string&)> NumberFrom(T min, T max, std::string what);

}  // namespace terrace::cli
