// Memory for the large arrays of a run. It grows without copies, occupies only the pages that were written to, and
// stays with the thread for its next run. New pages must be cleared by the system, which costs a small run more time
// than its queue does. Blocks come from the system (mmap): unused capacity takes addresses but no memory. A block may
// be given back by another thread than the one that took it; it then stays with that thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <new>
#include <type_traits>
#include <utility>

namespace terrace::tin {

// The largest total size of blocks that a thread keeps.
inline constexpr std::size_t kMaxSpareBytes = std::size_t{8} << 20;

// Returns a block of at least `bytes` bytes, aligned to a cache line. Throws std::bad_alloc.
void* TakeBlock(std::size_t bytes);
// Returns a block of the new size with the first `used` bytes of `block`: `block` itself, grown, or a new block that
// replaces it.
void* GrowBlock(void* block, std::size_t used, std::size_t bytes);
// Gives a block to this thread, which keeps up to kMaxSpareBytes for its next calls of TakeBlock.
void GiveBlock(void* block) noexcept;
// Like GiveBlock, but returns the memory to the system at once.
void ReleaseBlock(void* block) noexcept;

// The bytes that this thread keeps; and a function that releases them. For measurements of a run's memory.
std::size_t SpareBytes();
void ReleaseSpareBlocks();

// An array of trivially copyable values in such a block. Reserving is cheap: reserve the largest likely size, so that
// later runs of the same size reuse the block.
template <typename T>
class LargeArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  LargeArray() = default;
  LargeArray(LargeArray&& other) noexcept { Swap(other); }
  LargeArray& operator=(LargeArray&& other) noexcept {
    LargeArray(std::move(other)).Swap(*this);
    return *this;
  }
  ~LargeArray() {
    if (values_ != nullptr) GiveBlock(values_);
  }

  T* data() { return values_; }
  const T* data() const { return values_; }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return capacity_; }
  bool empty() const { return size_ == 0; }
  T* begin() { return values_; }
  T* end() { return values_ + size_; }
  const T* begin() const { return values_; }
  const T* end() const { return values_ + size_; }
  T& operator[](std::size_t i) { return values_[i]; }
  const T& operator[](std::size_t i) const { return values_[i]; }

  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    capacity = std::max(capacity, kMinBytes / sizeof(T));
    if (capacity > std::numeric_limits<std::size_t>::max() / 2 / sizeof(T)) throw std::bad_array_new_length();
    values_ = static_cast<T*>(values_ == nullptr ? TakeBlock(capacity * sizeof(T))
                                                 : GrowBlock(values_, size_ * sizeof(T), capacity * sizeof(T)));
    capacity_ = capacity;
  }
  // Values that are added are uninitialized.
  void GrowBy(std::size_t count) {
    if (count > capacity_ - size_) [[unlikely]]
      reserve(std::max(size_ + count, 2 * capacity_));
    size_ += count;
  }
  // Grows to `size` and sets the added values. Precondition: `size` is at least the current size.
  void GrowTo(std::size_t size, const T& value) {
    const std::size_t before = size_;
    GrowBy(size - before);
    std::fill(values_ + before, values_ + size, value);
  }
  // Empties the array and returns its memory to the system, not to the thread. For an array that is no longer needed at
  // this size.
  void Release() {
    if (values_ != nullptr) ReleaseBlock(values_);
    values_ = nullptr;
    size_ = capacity_ = 0;
  }
  void push_back(const T& value) {
    const T copy = value;  // it may be one of the array's own
    GrowBy(1);
    values_[size_ - 1] = copy;
  }
  template <typename Values>
  void Append(const Values& values) {
    reserve(size_ + values.size());
    for (const auto& value : values) push_back(value);
  }

 private:
  static constexpr std::size_t kMinBytes = std::size_t{16} << 10;

  void Swap(LargeArray& other) noexcept {
    std::swap(values_, other.values_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  T* values_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace terrace::tin
