// CPU time of the calling thread, which other programs on the machine affect little.
#pragma once

#include <ctime>

namespace terrace::bench {

// Seconds since some moment in the past.
inline double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// CPU seconds of `work`.
template <typename Work>
double SecondsOf(Work&& work) {
  const double start = ThreadSeconds();
  work();
  return ThreadSeconds() - start;
}

}  // namespace terrace::bench
