// The system's text of an error number.
#pragma once

#include <cerrno>
#include <string>

namespace terrace {

// "No such file or directory".
std::string ErrorText(int error = errno);

}  // namespace terrace
