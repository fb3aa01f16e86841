// Makes paths on the command line absolute: relative to the working directory at the start, even if that is renamed or
// removed later.
#pragma once

#include <filesystem>
#include <string>

namespace terrace::config {

// The error for a relative path if the working directory has no name.
inline constexpr const char* kNoWorkingDirectory =
    "is relative to the working directory, which cannot be named; give the path in full";

// `directory`: the working directory as the system names it, without symbolic links; empty: `path` is returned
// unchanged. Each ".." at the start of `path` removes a folder from the name, so the result stays valid even if that
// folder is removed.
std::string FromWorkingDirectory(std::filesystem::path directory, const std::filesystem::path& path);

}  // namespace terrace::config
