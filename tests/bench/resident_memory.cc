#include "tests/bench/resident_memory.h"

#include <malloc.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace terrace::bench {
namespace {

// "Key:   1234 kB" in a file of /proc.
std::size_t BytesIn(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string word; in >> word;) {
    std::size_t kilobytes = 0;
    if (word == key && in >> kilobytes) return kilobytes * 1024;
  }
  return 0;
}

std::size_t Anonymous() { return BytesIn("/proc/self/smaps_rollup", "Anonymous:"); }
std::size_t Since(std::size_t before, std::size_t now) { return now > before ? now - before : 0; }

}  // namespace

ResidentMemory::ResidentMemory() {
  ::malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";  // resets the peak
  resident_before_ = BytesIn("/proc/self/status", "VmRSS:");
  anonymous_before_ = Anonymous();
}

std::size_t ResidentMemory::PeakBytes() const {
  return std::max(Since(resident_before_, BytesIn("/proc/self/status", "VmHWM:")),
                  Since(anonymous_before_, Anonymous()));
}

}  // namespace terrace::bench
