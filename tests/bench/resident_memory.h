// How much memory the process holds: pages that it has written to, whoever gave them.
#pragma once

#include <cstddef>

namespace terrace::bench {

// Counts from the present on. What the heap holds in reserve goes back to the system first.
class ResidentMemory {
 public:
  ResidentMemory();

  // The most since then, bytes beyond what there was: by the system's own mark, which is some dozen pages off, or by a
  // count of pages now, whichever is more. 0 where the system tells neither.
  std::size_t PeakBytes() const;

 private:
  std::size_t resident_before_, anonymous_before_;
};

}  // namespace terrace::bench
