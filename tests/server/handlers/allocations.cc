#include "tests/server/handlers/allocations.h"

#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace terrace::server {
namespace {

thread_local StopAtAllocation* stopping = nullptr;

}  // namespace

std::atomic<std::size_t> held_bytes{0}, peak_bytes{0};

StopAtAllocation::StopAtAllocation(std::size_t at_bytes) : at_bytes_(at_bytes) { stopping = this; }
StopAtAllocation::~StopAtAllocation() { stopping = nullptr; }

void StopAtAllocation::Note(std::size_t bytes) {
  if (source_.stop_requested()) {
    largest_after_ = std::max(largest_after_, bytes);
  } else if (bytes >= at_bytes_) {
    source_.request_stop();
  }
}

namespace {

void* Allocate(std::size_t size) {
  if (stopping != nullptr) stopping->Note(size);
  void* const memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  const std::size_t now = held_bytes += ::malloc_usable_size(memory);
  if (now > peak_bytes) peak_bytes = now;
  return memory;
}
void Free(void* memory) {
  if (memory != nullptr) held_bytes -= ::malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace
}  // namespace terrace::server

void* operator new(std::size_t size) { return terrace::server::Allocate(size); }
void operator delete(void* memory) noexcept { terrace::server::Free(memory); }
void operator delete(void* memory, std::size_t) noexcept { terrace::server::Free(memory); }
