// The configuration file: JSON text to Config and back. config.schema.json describes it to editors.
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

// Everything that is wrong, in the order of the text. After a syntax error there is nothing but that.
using ConfigResult = tl::expected<Config, std::vector<ConfigError>>;

// `directory` is where relative paths in `text` start; globs in `sources` are looked up there.
ConfigResult ParseConfig(std::string_view text, const std::filesystem::path& directory);

// Of a file; a larger one is refused unread.
inline constexpr std::size_t kMaxConfigBytes = std::size_t{16} << 20;

// Reads and parses a file; its folder is the directory. A file that cannot be read is one error with the path "".
ConfigResult LoadConfig(const std::filesystem::path& file);

// All options as JSON with two spaces of indentation and a final newline. ParseConfig reads it back to an equal Config.
std::string ToJson(const Config& config);

// What a path of the command line stands for: a file or a folder, never a glob (the shell has expanded those).
// kNotFound, kUnavailable: a folder without files, or one that cannot be read.
Result<SourceConfig> SourceAt(const std::string& path);

}  // namespace terrace::config
