// Suggestions for unknown keys of the configuration. For this module only.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "config/common/nearest_name.h"

namespace terrace::config {

// Returns a sentence for the error at the key. `known`: the keys of its object. If another kind of object has the key,
// the sentence says where it belongs; else it names similar keys. Empty: the key resembles no known one, and no message
// may quote it.
std::string ExplainKey(std::string_view key, std::span<const KnownName> known);

}  // namespace terrace::config
