// Checks that a folder is writable, without creating it.
#pragma once

#include <filesystem>

#include "engine/core/result.h"

namespace terrace::cli {

// If the folder does not exist, checks that it could be created. kUnavailable: the message names the obstacle and the
// remedy.
Result<void> CheckFolder(const std::filesystem::path& folder);

}  // namespace terrace::cli
