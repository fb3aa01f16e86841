// The memory that this process occupies, for tests that bound it.
#pragma once

#include <unistd.h>

#include <fstream>

namespace terrace::test_support {

// Sanitizers keep freed memory and have shadow memory, so resident memory means nothing there.
#if defined(__has_feature)
inline constexpr bool kSanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
inline constexpr bool kSanitized = false;
#endif

inline long ResidentKib() {
  std::ifstream statm("/proc/self/statm");
  long size = 0, resident = 0;
  statm >> size >> resident;
  return resident * (::sysconf(_SC_PAGESIZE) / 1024);
}

}  // namespace terrace::test_support
