// Names that datasets cannot have. For this module only.
#pragma once

#include <span>
#include <string_view>

namespace terrace::config {

// First path segments of the server's own URLs.
std::span<const std::string_view> ReservedDatasetNames();

}  // namespace terrace::config
