// What a key that an object of the configuration does not have was meant to be. Used inside this room only.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "config/common/nearest_name.h"

namespace terrace::config {

// For an error at the key; `known`: the keys that its object may have. Names where the key belongs if another kind of
// object has it, else what it resembles, here or there. Empty: it resembles nothing, and no message may quote it.
std::string ExplainKey(std::string_view key, std::span<const KnownName> known);

}  // namespace terrace::config
