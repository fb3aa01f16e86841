// TERRACE_CHECK: aborts if a condition is false. Only a programming error can make it false. Active in every build.
#pragma once

namespace terrace {

// Prints the condition and its source location on stderr and aborts.
[[noreturn]] void CheckFailed(const char* condition, const char* file, int line);

}  // namespace terrace

#define TERRACE_CHECK(condition) \
  (static_cast<bool>(condition) ? static_cast<void>(0) : ::terrace::CheckFailed(#condition, __FILE__, __LINE__))
