#include "config/common/nearest_name.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

namespace terrace::config {
namespace {

std::string Fold(std::string_view name) {
  std::string folded(name);
  for (char& c : folded) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '-') c = '_';
  }
  return folded;
}

// Optimal string alignment: insertions, deletions, substitutions and swaps of neighbours count one each.
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> two_above(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
  std::iota(above.begin(), above.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitution = above[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, substitution});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], two_above[j - 2] + 1);
    }
    two_above.swap(above);
    above.swap(row);
  }
  return above[b.size()];
}

// Whether a name has the word as one of its parts: "max_error" has "error".
bool HasPart(std::string_view name, std::string_view word) {
  const std::size_t at = name.find(word);
  if (at == std::string_view::npos || word.empty()) return false;
  const std::size_t end = at + word.size();
  return (at == 0 || name[at - 1] == '_') && (end == name.size() || name[end] == '_');
}

}  // namespace

std::string_view NearestName(std::string_view word, std::span<const std::string_view> candidates) {
  constexpr std::size_t kLongestWord =
      64;  // nothing that people mistype is longer, and the distance takes quadratic time
  if (word.size() > kLongestWord) return {};
  const std::string folded = Fold(word);
  std::string_view nearest;
  std::size_t smallest = kLongestWord;
  for (const std::string_view candidate : candidates) {
    const std::size_t distance = EditDistance(folded, Fold(candidate));
    const std::size_t limit = std::max<std::size_t>(1, std::max(word.size(), candidate.size()) / 3);
    if (distance > limit || distance >= smallest) continue;
    smallest = distance;
    nearest = candidate;
  }
  if (!nearest.empty()) return nearest;
  const std::string_view part = std::string_view(folded).substr(std::min(folded.find_first_not_of('_'), folded.size()));
  const auto has_part = [&](std::string_view candidate) { return HasPart(Fold(candidate), part); };
  if (std::ranges::count_if(candidates, has_part) != 1) return {};
  return *std::ranges::find_if(candidates, has_part);
}

}  // namespace terrace::config
