// Memory budget for averages that are not in a cache folder.
#pragma once

#include <atomic>
#include <cstddef>

namespace terrace::dem {

// The bytes that all models opened with this object (RasterCache::memory) may use for averages. Thread-safe.
class AveragesBudget {
 public:
  static constexpr std::size_t kDefaultBytes = std::size_t{128} << 20;

  explicit AveragesBudget(std::size_t bytes = kDefaultBytes) : left_(bytes) {}

  std::size_t left() const { return left_; }
  // Takes bytes from the budget. Returns false if fewer are left.
  bool Take(std::size_t bytes) {
    std::size_t left = left_;
    while (left >= bytes) {
      if (left_.compare_exchange_weak(left, left - bytes)) return true;
    }
    return false;
  }
  void Give(std::size_t bytes) { left_ += bytes; }

 private:
  std::atomic<std::size_t> left_;
};

}  // namespace terrace::dem
