// Tables of values and their names in URLs, in the configuration and in files.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "engine/core/check.h"

namespace terrace {

template <typename T, std::size_t kCount>
using Names = std::array<std::pair<std::string_view, T>, kCount>;

// Returns the value that has this name; nullopt if there is none.
template <typename T, std::size_t kCount>
std::optional<T> ValueNamed(const Names<T, kCount>& names, std::string_view name) {
  const auto* const found = std::ranges::find(names, name, [](const auto& known) { return known.first; });
  return found == names.end() ? std::nullopt : std::optional<T>(found->second);
}

// Precondition: the value is in the table.
template <typename T, std::size_t kCount>
std::string_view NameIn(const Names<T, kCount>& names, T value) {
  const auto* const found = std::ranges::find(names, value, [](const auto& known) { return known.second; });
  TERRACE_CHECK(found != names.end());
  return found->first;
}

}  // namespace terrace
