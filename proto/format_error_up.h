// The text of errors in headers and documents.
#pragma once

#include <string>

namespace terrace::proto {

// Metres with six significant digits, rounded up: never below `error_m`. Also valid as a JSON number.
std::string FormatErrorUp(double error_m);

}  // namespace terrace::proto
