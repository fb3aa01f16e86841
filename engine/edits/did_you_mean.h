// Hints in messages about misspelt words.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrace::dem {

// Letters to insert, remove or replace.
inline std::size_t LettersApart(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

// `; did you mean "..."?` with the nearest of the names; empty if none is near.
template <typename Names>
std::string DidYouMean(std::string_view word, const Names& names) {
  std::string_view best;
  std::size_t fewest = std::numeric_limits<std::size_t>::max();
  for (const std::string_view name : names) {
    const std::size_t apart = LettersApart(word, name);
    if (apart < fewest) fewest = apart, best = name;
  }
  return 3 * fewest <= std::max(word.size(), best.size()) + 1 ? fmt::format("; did you mean \"{}\"?", best) : "";
}

}  // namespace terrace::dem
