// The `sources` of a dataset: paths and globs as people write them, to files. Used inside this room only.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::config {

// A relative path counts from `directory`. A path without *, ? and [, or one that exists as it is written, stands for
// itself, whether or not the file exists: opening it tells more than a lookup. A glob becomes the files that match it,
// in byte order. kNotFound: nothing matches. kUnavailable: a folder is missing or
// cannot be read.
Result<std::vector<std::string>> ExpandSource(const std::string& written, const std::filesystem::path& directory);

}  // namespace terrace::config
