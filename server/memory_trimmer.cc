#include "server/memory_trimmer.h"

#include <malloc.h>

#include <ctime>

namespace terrace::server {
namespace {

// Processor time of all threads. A build takes milliseconds; an idle server uses less in three seconds.
constexpr std::clock_t kWorthIt = CLOCKS_PER_SEC / 200;

void Trim() {
#ifdef __GLIBC__
  ::malloc_trim(0);
#endif
}

}  // namespace

MemoryTrimmer::MemoryTrimmer(std::chrono::milliseconds period) : thread_([this, period] { Run(period); }) {}

MemoryTrimmer::~MemoryTrimmer() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void MemoryTrimmer::Run(std::chrono::milliseconds period) {
  std::clock_t worked = std::clock();
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, period, [this] { return stopped_; })) {
    if (std::clock() - worked < kWorthIt) continue;
    Trim();
    worked = std::clock();
  }
}

}  // namespace terrace::server
