// CPU time of the calling thread: what a benchmark charges to the mesher, whatever else runs on the machine.
#pragma once

#include <ctime>

namespace terrace::bench {

// Seconds since some moment in the past.
inline double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// What `work` costs.
template <typename Work>
double SecondsOf(Work&& work) {
  const double start = ThreadSeconds();
  work();
  return ThreadSeconds() - start;
}

}  // namespace terrace::bench
