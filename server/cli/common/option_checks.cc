#include "server/cli/common/option_checks.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <utility>

#include "engine/core/nearest_name.h"

namespace terrace::cli {

template <typename T>
OptionCheck NumberFrom(T min, T max, std::string what) {
  return [min, max, what = std::move(what)](const std::string& text) {
    T number{};
    const bool valid = CLI::detail::lexical_cast(text, number) && number >= min && number <= max;
    return valid ? std::string() : fmt::format("must be {}, not \"{}\"", what, text);
  };
}

template OptionCheck NumberFrom(int min, int max, std::string what);
template OptionCheck NumberFrom(unsigned min, unsigned max, std::string what);
template OptionCheck NumberFrom(double min, double max, std::string what);

OptionCheck NumberAbove0(std::string what) {
  return NumberFrom(std::numeric_limits<double>::denorm_min(), 1e9, std::move(what));
}

OptionCheck OneOf(std::vector<std::string> words) {
  return [words = std::move(words)](const std::string& text) {
    const bool valid = std::ranges::find(words, text) != words.end();
    return valid ? std::string() : fmt::format("must be {}, not \"{}\"", Alternatives(words), text);
  };
}

}  // namespace terrace::cli
