#include "server/cli/common/number_check.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <utility>

namespace terrace::cli {

template <typename T>
std::function<std::string(const std::string&)> NumberFrom(T min, T max, std::string what) {
  return [min, max, what = std::move(what)](const std::string& text) {
    T number{};
    const bool valid = CLI::detail::lexical_cast(text, number) && number >= min && number <= max;
    return valid ? std::string() : fmt::format("must be {}, not \"{}\"", what, text);
  };
}

template std::function<std::string(const std::string&)> NumberFrom(int min, int max, std::string what);
template std::function<std::string(const std::string&)> NumberFrom(unsigned min, unsigned max, std::string what);
template std::function<std::string(const std::string&)> NumberFrom(double min, double max, std::string what);

}  // namespace terrace::cli
