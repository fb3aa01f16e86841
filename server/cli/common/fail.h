// How a command ends.
#pragma once

#include <cstdio>
#include <string>

#include "server/cli/common/command.h"

namespace terrace::cli {

// Prints "terrace: MESSAGE" on stderr; returns the exit code.
inline int Fail(const std::string& message, int code) {
  std::fprintf(stderr, "terrace: %s\n", message.c_str());
  return code;
}

// What was asked for on stdout is not there before it has been taken: returns the exit code, or that of a failure.
inline int FinishOutput(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::perror("terrace: stdout cannot be written");
  return code == kExitOk ? kExitFailure : code;
}

}  // namespace terrace::cli
