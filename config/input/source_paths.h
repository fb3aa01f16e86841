// The `sources` of a dataset: paths, globs and folders as people write them, to files. Used inside this room only.
#pragma once

#include <filesystem>
#include <string>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::config {

// A relative path counts from `directory`. A path without *, ? and [, or one that exists as it is written, stands for
// itself, whether or not the file exists: opening it tells more than a lookup. A glob becomes the files that match it,
// a folder the files in it, but for hidden ones; both in byte order. kNotFound: nothing matches, or the folder is
// empty. kUnavailable: a folder is missing or cannot be read.
Result<SourceConfig> ExpandSource(const std::string& written, const std::filesystem::path& directory);

// Whether ExpandSource made it of a folder or a glob; else it stands for itself.
bool IsExpanded(const SourceConfig& source);
// Of one that is: whether it holds other files by now.
bool HoldsOtherFiles(const SourceConfig& source);

}  // namespace terrace::config
