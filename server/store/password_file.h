// The password of a Redis in a file.
#pragma once

#include <string>

#include "engine/core/result.h"

namespace terrace::server {

// The first line of the file, without its end ("\n" or "\r\n"). kInvalidArgument: the line has more than 4095 bytes.
// kUnavailable: the file cannot be read, or the line is empty.
Result<std::string> ReadPassword(const std::string& file);

}  // namespace terrace::server
