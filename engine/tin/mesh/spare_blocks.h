// Memory for the large arrays of a run. It grows without copies, occupies only what was written to, and is kept by the
// thread for its next run. New pages must be cleared by the system, which costs a small run more than its queue does.
//
// Blocks come from the system (mmap): room that is never used takes addresses and no memory. A block may be given back
// by another thread than the one that took it; that thread then keeps it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <new>
#include <type_traits>
#include <utility>

namespace terrace::tin {

// What a thread keeps at most, by size.
inline constexpr std::size_t kMaxSpareBytes = std::size_t{8} << 20;

// A block of at least so many bytes, aligned to a cache line; throws std::bad_alloc.
void* TakeBlock(std::size_t bytes);
// Returns a block of the new size with the first `used` bytes of `block`: `block` itself, grown, or another one in its
// place.
void* GrowBlock(void* block, std::size_t used, std::size_t bytes);
void GiveBlock(void* block) noexcept;
// The same, but the thread does not keep it: its memory goes back to the system at once.
void ReleaseBlock(void* block) noexcept;

// The bytes that this thread keeps, and their release. For measurements of a run's memory.
std::size_t SpareBytes();
void ReleaseSpareBlocks();

// An array of plain values in such a block. Reserving is cheap: reserve for the largest likely size. Runs of fields of
// one size then find blocks that fit.
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
  // Grows to a size, which is not smaller than the present one, and sets the values that are added.
  void GrowTo(std::size_t size, const T& value) {
    const std::size_t before = size_;
    GrowBy(size - before);
    std::fill(values_ + before, values_ + size, value);
  }
  // Empties the array and gives its memory back to the system, not to the thread. For an array that a large run has
  // outgrown.
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
