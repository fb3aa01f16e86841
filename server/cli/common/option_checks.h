// Checks of an option's value, for CLI::Option::check. The message follows the name of the option. A check adds nothing
// to the help.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace terrace::cli {

using OptionCheck = std::function<std::string(const std::string&)>;

// Refuses what is no T from `min` to `max`, NaN too, which CLI::Range accepts. `what`: "a number from 0 to 1". T: int,
// unsigned or double.
template <typename T>
OptionCheck NumberFrom(T min, T max, std::string what);

// Above 0, and at most 1e9.
OptionCheck NumberAbove0(std::string what);

OptionCheck OneOf(std::vector<std::string> words);

}  // namespace terrace::cli
