// Memory for the large arrays of a run, kept by the thread for its next one: pages that the system hands out anew, and
// clears, cost a small run more than its queue does.
//
// Blocks may be given back by another thread than the one that took them, which then keeps them.
#pragma once

#include <cstddef>
#include <limits>
#include <new>
#include <vector>

namespace terrace::tin {

// What a thread keeps at most.
inline constexpr std::size_t kMostSpareBytes = std::size_t{8} << 20;

// A block of at least so many bytes, aligned to a cache line; throws std::bad_alloc.
void* TakeBlock(std::size_t bytes);
void GiveBlock(void* block) noexcept;

// What this thread keeps, and an end to it: to measure what a run takes.
std::size_t SpareBytes();
void ReleaseSpareBlocks();

// Arrays below kLeastBytes are not worth keeping.
template <typename T>
class SpareBlockAllocator {
 public:
  using value_type = T;

  SpareBlockAllocator() = default;
  template <typename U>
  SpareBlockAllocator(const SpareBlockAllocator<U>&) {}  // NOLINT: allocators convert

  T* allocate(std::size_t count) {
    if (count > std::numeric_limits<std::size_t>::max() / 2 / sizeof(T)) throw std::bad_array_new_length();
    return static_cast<T*>(IsSmall(count) ? ::operator new(count * sizeof(T)) : TakeBlock(count * sizeof(T)));
  }
  void deallocate(T* array, std::size_t count) noexcept {
    IsSmall(count) ? ::operator delete(array) : GiveBlock(array);
  }
  friend bool operator==(SpareBlockAllocator, SpareBlockAllocator) { return true; }

 private:
  static constexpr std::size_t kLeastBytes = std::size_t{16} << 10;
  static bool IsSmall(std::size_t count) { return count * sizeof(T) < kLeastBytes; }
};

template <typename T>
using LargeArray = std::vector<T, SpareBlockAllocator<T>>;

}  // namespace terrace::tin
