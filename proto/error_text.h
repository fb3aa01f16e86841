// Errors as headers and documents state them.
#pragma once

#include <string>

namespace terrace::proto {

// Metres with six significant digits, never below `error_m`. A number in JSON too.
std::string FormatErrorUp(double error_m);

}  // namespace terrace::proto
