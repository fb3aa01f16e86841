// The check of an option's number.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string>

namespace terrace::cli {

// Refuses what is no T from `min` to `max`, NaN too, which CLI::Range accepts. The message follows the name of the
// option; `what`: "a number from 0 to 1". The check adds nothing to the help.
template <typename T>
CLI::Validator NumberFrom(T min, T max, const std::string& what) {
  const auto check = [=](const std::string& text) {
    T number{};
    const bool valid = CLI::detail::lexical_cast(text, number) && number >= min && number <= max;
    return valid ? std::string() : fmt::format("must be {}, not \"{}\"", what, text);
  };
  return CLI::Validator(check, "");
}

}  // namespace terrace::cli
