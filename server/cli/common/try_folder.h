// Whether a folder can be written to, told without making it.
#pragma once

#include <filesystem>

#include "engine/core/result.h"

namespace terrace::cli {

// Where it is missing, whether it could be made. kUnavailable: names what is in the way, and the remedy.
Result<void> TryFolder(const std::filesystem::path& folder);

}  // namespace terrace::cli
