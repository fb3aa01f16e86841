#include "engine/core/nearest_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

namespace terrace {
namespace {

std::string Fold(std::string_view name) {
  std::string folded(name.substr(std::min(name.find_first_not_of("-_"), name.size())));
  for (char& c : folded) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '-') c = '_';
  }
  return folded;
}

bool HasWord(std::string_view words, std::string_view word) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    if (words.substr(0, end) == word) return true;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  return false;
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

// Whether the word is one of the name's parts: "max_error" has "error".
bool HasPart(std::string_view name, std::string_view word) {
  const std::size_t at = name.find(word);
  if (at == std::string_view::npos || word.empty()) return false;
  const std::size_t end = at + word.size();
  return (at == 0 || name[at - 1] == '_') && (end == name.size() || name[end] == '_');
}

// The first name with the smallest distance, if that is small enough.
std::vector<std::string_view> ByDistance(const std::string& word, std::span<const KnownName> known) {
  std::vector<std::string_view> nearest;
  std::size_t smallest = word.size() + 1;
  for (const KnownName& candidate : known) {
    const std::string name = Fold(candidate.name);
    const std::size_t distance = EditDistance(word, name);
    const std::size_t limit = std::max<std::size_t>(1, std::max(word.size(), name.size()) / 3);
    if (distance > limit || distance >= smallest) continue;
    smallest = distance;
    nearest = {candidate.name};
  }
  return nearest;
}

}  // namespace

std::vector<std::string_view> NearestNames(std::string_view word, std::span<const KnownName> known) {
  constexpr std::size_t kMaxNames = 4, kMinBeginning = 3, kMaxRest = 8;
  // Mistyped names are shorter, and the distance takes quadratic time.
  constexpr std::size_t kLongestWord = 64;
  const std::string folded = word.size() > kLongestWord ? "" : Fold(word);
  if (folded.empty()) return {};
  const auto where = [&](auto&& fits) {
    std::vector<std::string_view> names;
    for (const KnownName& candidate : known) {
      if (fits(candidate)) names.push_back(candidate.name);
    }
    return names;
  };
  std::vector<std::string_view> names =
      where([&](const KnownName& candidate) { return HasWord(candidate.other_words, folded); });
  if (names.empty()) names = ByDistance(folded, known);
  if (names.empty()) {
    names = where([&](const KnownName& candidate) {
      const std::string name = Fold(candidate.name);
      const bool is_beginning = folded.starts_with(name) && name.size() >= kMinBeginning;
      return HasPart(name, folded) || (is_beginning && folded.size() - name.size() <= kMaxRest);
    });
  }
  return names.size() > kMaxNames ? std::vector<std::string_view>() : names;
}

bool IsSameName(std::string_view a, std::string_view b) { return Fold(a) == Fold(b); }

std::vector<std::string> Quoted(const std::vector<std::string_view>& names) {
  std::vector<std::string> quoted;
  for (const std::string_view name : names) quoted.push_back(fmt::format("\"{}\"", name));
  return quoted;
}

std::string Alternatives(std::span<const std::string> names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  }
  return text;
}

std::string DidYouMean(std::span<const std::string> names) {
  return names.empty() ? "" : fmt::format("; did you mean {}?", Alternatives(names));
}

}  // namespace terrace
