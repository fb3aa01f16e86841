// Converts the JSON text of a configuration file to a Config and back. Editors use config.schema.json.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::config {

// A Config, or its errors, at most kMaxConfigErrors. A syntax error is the only error.
using ConfigResult = tl::expected<Config, std::vector<ConfigError>>;

// `directory`: the folder that relative paths and globs in `text` are relative to.
ConfigResult ParseConfig(std::string_view text, const std::filesystem::path& directory);

// Larger files are refused without reading them.
inline constexpr std::size_t kMaxConfigBytes = std::size_t{16} << 20;

// Reads and parses a file. Relative paths are relative to its folder. If the file cannot be read, returns one error
// with the path "".
ConfigResult LoadConfig(const std::filesystem::path& file);

// Writes all options as JSON with two spaces of indentation and a final newline. ParseConfig converts it back to an
// equal Config.
std::string ToJson(const Config& config);

// Returns the source for a path on the command line: a file or a folder, never a glob, because the shell expands globs.
// kNotFound: the folder has no files. kUnavailable: the folder cannot be read.
Result<SourceConfig> SourceAt(const std::string& path);

}  // namespace terrace::config
