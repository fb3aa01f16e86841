// JSON text to a JSON value, stricter than the library: a key that appears twice is an error, and syntax errors tell
// the line and the column. An object has 1000 keys at most, and 100
// lists and objects may stand in one another. No error quotes the text. Used inside this room only.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace terrace::config {

// Keeps the order of keys, so that errors come in the order of the file.
using Json = nlohmann::ordered_json;

// Enough errors to work on; further ones are not told, as a file of another kind may be wrong in millions of places.
inline constexpr std::size_t kMaxConfigErrors = 100;

// The value; errors are appended. After a syntax error (path "") the value is discarded (Json::is_discarded).
Json ParseJsonText(std::string_view text, std::vector<ConfigError>& errors);

// `path` + "/" + `key`, escaped after RFC 6901.
std::string AppendKey(const std::string& path, std::string_view key);

}  // namespace terrace::config
