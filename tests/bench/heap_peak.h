// How much heap the program holds: operator new and delete are replaced in programs that link this.
#pragma once

#include <cstddef>

namespace terrace::bench {

// Bytes in use now, as the allocator rounds them, and the most since the last ResetHeapPeak. All threads together.
std::size_t HeapBytes();
std::size_t HeapPeakBytes();
void ResetHeapPeak();

}  // namespace terrace::bench
