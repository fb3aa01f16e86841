// Expands the `sources` of a dataset: paths, globs and folders, to files. For the modules of config/ only.
#pragma once

#include <filesystem>
#include <string>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::config {

// Relative paths are relative to `directory`. A path without *, ? and [, or a path that exists literally, is one file.
// It need not exist: the error of opening it will be more specific. A glob becomes the files that match it, and a
// folder the files in it except hidden ones, in byte order. kNotFound: no file matches, or the folder is empty.
// kUnavailable: a folder is missing or cannot be read.
Result<SourceConfig> ExpandSource(const std::string& written, const std::filesystem::path& directory);

// Whether the source is a folder or a glob, not a single file.
bool IsExpanded(const SourceConfig& source);
// Whether an expanded source now has other files. Precondition: IsExpanded.
bool HoldsOtherFiles(const SourceConfig& source);

}  // namespace terrace::config
