// "Did you mean ...?": the known name that a mistyped one is closest to.
#pragma once

#include <span>
#include <string_view>

namespace terrace::config {

// The candidate with the smallest edit distance to `word` (letter case and '-' against '_' ignored), the first of
// equals, if at most a third of the longer name has to change; else the only candidate that has `word` as a part
// ("error" in "max_error"); else empty.
std::string_view NearestName(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace terrace::config
