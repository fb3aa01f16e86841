#include "tests/bench/heap_peak.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace terrace::bench {
namespace {

std::atomic<std::size_t> bytes_in_use{0};
std::atomic<std::size_t> peak_bytes{0};

void* Track(void* block) {
  if (block == nullptr) throw std::bad_alloc();
  const std::size_t now = bytes_in_use += malloc_usable_size(block);
  std::size_t peak = peak_bytes.load();
  while (now > peak && !peak_bytes.compare_exchange_weak(peak, now)) {
  }
  return block;
}

void Release(void* block) {
  if (block == nullptr) return;
  bytes_in_use -= malloc_usable_size(block);
  std::free(block);
}

}  // namespace

std::size_t HeapBytes() { return bytes_in_use; }
std::size_t HeapPeakBytes() { return peak_bytes; }
void ResetHeapPeak() { peak_bytes = bytes_in_use.load(); }

}  // namespace terrace::bench

void* operator new(std::size_t size) { return terrace::bench::Track(std::malloc(size)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto step = static_cast<std::size_t>(alignment);
  return terrace::bench::Track(std::aligned_alloc(step, (size + step - 1) / step * step));
}
// The library's own would do, were it not replaced itself under sanitizers.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  try {
    return operator new(size);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void operator delete(void* block) noexcept { terrace::bench::Release(block); }
void operator delete(void* block, std::size_t) noexcept { terrace::bench::Release(block); }
void operator delete(void* block, std::align_val_t) noexcept { terrace::bench::Release(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { terrace::bench::Release(block); }
