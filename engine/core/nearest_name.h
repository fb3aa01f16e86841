// Suggestions for unknown names: "Did you mean ...?".
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace terrace {

struct KnownName {
  std::string_view name;              // "cache_bytes" or "--cache-bytes"
  std::string_view other_words = {};  // names that other programs use, separated by blanks: "port host"
};

// Returns the known names that `word` may mean, in the order of `known`; empty if there are none, or more than four.
// Uses the first of these rules that finds a name. Ignores letter case, the difference between '-' and '_', and leading
// dashes.
//   - Names that have `word` among their other words.
//   - The name with the smallest edit distance, the first of equals, if at most a third of the longer one has to
//   change.
//   - Names that contain `word` ("error" in "max_error"), and names that `word` extends by only a few letters ("out"
//   for "output"). A longer extension could be a secret in the wrong place, which must not be quoted.
std::vector<std::string_view> NearestNames(std::string_view word, std::span<const KnownName> known);

// Whether two names are equal apart from the differences that NearestNames ignores.
bool IsSameName(std::string_view a, std::string_view b);

std::vector<std::string> Quoted(const std::vector<std::string_view>& names);

// "a", "a or b", "a, b or c".
std::string Alternatives(std::span<const std::string> names);

// "; did you mean a, b or c?"; empty without names.
std::string DidYouMean(std::span<const std::string> names);

}  // namespace terrace
