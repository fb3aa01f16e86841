// "Did you mean ...?": the known names that an unknown one may stand for.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace terrace::config {

struct KnownName {
  std::string_view name;              // "cache_bytes" or "--cache-bytes"
  std::string_view other_words = {};  // what others call it, with blanks between them: "port host"
};

// What `word` may stand for, in the order of `known`; empty: nothing that is known, or more than four names. The first
// of these rules that finds any counts. Letter case, '-' against '_' and dashes at the beginning are ignored.
//   - Names that have `word` among their other words.
//   - The name with the smallest edit distance, the first of equals, if at most a third of the longer one has to
//   change.
//   - Names that have `word` as a part ("error" in "max_error"), and names of which `word` is the beginning and little
//     more ("output" of "out"): what it is told with may be a secret in the wrong place.
std::vector<std::string_view> NearestNames(std::string_view word, std::span<const KnownName> known);

// Whether the two are one name, but for what NearestNames ignores.
bool IsSameName(std::string_view a, std::string_view b);

// "a", "a or b", "a, b or c".
std::string Alternatives(std::span<const std::string> names);

}  // namespace terrace::config
