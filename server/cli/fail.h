// How a command says that it failed.
#pragma once

#include <cstdio>
#include <string>

namespace terrace::cli {

// Prints "terrace: MESSAGE" on stderr; returns the exit code.
inline int Fail(const std::string& message, int code) {
  std::fprintf(stderr, "terrace: %s\n", message.c_str());
  return code;
}

}  // namespace terrace::cli
