// "Did you mean ...?": the known name that a mistyped one is closest to.
#pragma once

#include <span>
#include <string_view>

namespace terrace::config {

// The candidate with the smallest edit distance to `word` (letter case and '-' against '_' ignored), the first of
// equals; empty if none is close: more than a third of the longer name would have to change.
std::string_view NearestName(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace terrace::config
