#include "server/memory_trimmer.h"

#include <malloc.h>

#include <condition_variable>
#include <ctime>
#include <mutex>

namespace terrace::server {
namespace {

// Processor time of all threads. A build takes milliseconds; an idle server uses less in three seconds.
constexpr std::clock_t kWorthIt = CLOCKS_PER_SEC / 200;

void TrimRegularly(const std::stop_token& stop, std::chrono::milliseconds period) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any stopped;
  for (std::clock_t worked = std::clock();;) {
    stopped.wait_for(lock, stop, period, [] { return false; });
    if (stop.stop_requested()) return;
    if (std::clock() - worked < kWorthIt) continue;
#ifdef __GLIBC__
    ::malloc_trim(0);
#endif
    worked = std::clock();
  }
}

}  // namespace

MemoryTrimmer::MemoryTrimmer(std::chrono::milliseconds period)
    : thread_([period](const std::stop_token& stop) { TrimRegularly(stop, period); }) {}

}  // namespace terrace::server
