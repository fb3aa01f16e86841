// Names on the command line, in full: they count from the working directory at the start, whatever becomes of that.
#pragma once

#include <filesystem>
#include <string>

namespace terrace::config {

// What is wrong with a relative path where there is no such directory.
inline constexpr const char* kNoWorkingDirectory =
    "is relative to the working directory, which cannot be named; give the path in full";

// `directory` is a working directory as the system names it, so there are no symbolic links in it: what `path` goes up
// is taken off, and the name holds after the folders gone up from are removed. Empty: `path` stays as it is.
std::string FromWorkingDirectory(std::filesystem::path directory, const std::filesystem::path& path);

}  // namespace terrace::config
