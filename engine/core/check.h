// TERRACE_CHECK: conditions that only a mistake in this program can break. Active in every build.
#pragma once

namespace terrace {

// Prints the condition and its place on stderr and aborts.
[[noreturn]] void CheckFailed(const char* condition, const char* file, int line);

}  // namespace terrace

#define TERRACE_CHECK(condition) \
  (static_cast<bool>(condition) ? static_cast<void>(0) : ::terrace::CheckFailed(#condition, __FILE__, __LINE__))
