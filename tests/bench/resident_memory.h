// Measures the memory of the process: all pages that it has written, from any allocator.
#pragma once

#include <cstddef>

namespace terrace::bench {

// Measures from its construction on. The constructor first returns the heap's free memory to the system.
class ResidentMemory {
 public:
  ResidentMemory();

  // The peak since then, in bytes above the memory at construction: the system's own peak, which is some dozen pages
  // off, or the current count of pages, whichever is larger. 0 if the system provides neither.
  std::size_t PeakBytes() const;

 private:
  std::size_t resident_before_, anonymous_before_;
};

}  // namespace terrace::bench
