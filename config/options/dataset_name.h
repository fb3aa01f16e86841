// Names that datasets cannot have. Used inside this room only.
#pragma once

#include <span>
#include <string_view>

namespace terrace::config {

// First path segments that the server itself answers.
std::span<const std::string_view> ReservedDatasetNames();

}  // namespace terrace::config
