// Parses JSON text, more strictly than the library: duplicate keys are errors, objects have at most 1000 keys, and
// lists and objects are nested at most 100 deep. Syntax errors state line and column. No error quotes the text. For
// the modules of config/ only.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace terrace::config {

// Keeps the order of keys, so that errors are in the order of the file.
using Json = nlohmann::ordered_json;

// Limit of reported errors: a file of another kind may have millions.
inline constexpr std::size_t kMaxConfigErrors = 100;

// Returns the value and appends errors. After a syntax error (path "") the value is discarded (Json::is_discarded).
Json ParseJsonText(std::string_view text, std::vector<ConfigError>& errors);

}  // namespace terrace::config
