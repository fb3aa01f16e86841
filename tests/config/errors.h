// Errors of configurations, for tests.
#pragma once

#include <gmock/gmock.h>

#include <string>
#include <string_view>
#include <vector>

#include "config/file/parse.h"

namespace terrace::config {

// The errors of a text that must have errors. Relative paths are relative to a folder that does not exist.
inline std::vector<ConfigError> ErrorsOf(std::string_view text) {
  const ConfigResult result = ParseConfig(text, "/nowhere");
  return result ? std::vector<ConfigError>{} : result.error();
}

inline auto IsError(const std::string& path, const std::string& part_of_message) {
  return testing::AllOf(testing::Field("path", &ConfigError::path, path),
                        testing::Field("message", &ConfigError::message, testing::HasSubstr(part_of_message)));
}

}  // namespace terrace::config
