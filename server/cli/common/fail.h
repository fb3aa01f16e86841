// Error messages and the end of output of a command.
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

// Flushes stdout. Returns `code`, or kExitFailure if stdout could not be written.
inline int FinishOutput(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::perror("terrace: stdout cannot be written");
  return code == kExitOk ? kExitFailure : code;
}

}  // namespace terrace::cli
