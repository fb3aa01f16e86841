// Decides which look-ups in a remote store are worth their time. Keys belong to classes. Few look-ups are made for
// classes with few hits. Thread-safe.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace terrace::server {

class LookUpGate {
 public:
  explicit LookUpGate() {
    for (auto& share : shares_) share.store(kOne, std::memory_order_relaxed);
  }

  // `key_class`: below kClasses. In a class with few hits, only every kSample-th look-up is made: it
  // shows whether others have filled the store meanwhile.
  bool ShouldLookUp(std::size_t key_class) {
    const std::uint32_t number = counts_[key_class].fetch_add(1, std::memory_order_relaxed);
    return shares_[key_class].load(std::memory_order_relaxed) >= kMinShare || number % kSample == 0;
  }

  // Records the result of a look-up that was made. If two threads call it at once, one result may be lost.
  void Note(std::size_t key_class, bool found) {
    const std::uint32_t share = shares_[key_class].load(std::memory_order_relaxed);
    shares_[key_class].store(share - share / kMemory + (found ? kOne / kMemory : 0), std::memory_order_relaxed);
  }

  static constexpr std::size_t kClasses = 512;
  static constexpr std::uint32_t kSample = 16;

 private:
  // The share of look-ups that found something, as a moving average of about the last kMemory. It begins at 1, so that
  // a new process makes look-ups.
  static constexpr std::uint32_t kOne = 1U << 24, kMemory = 64;
  static constexpr std::uint32_t kMinShare = kOne / 20;  // a look-up takes about a twentieth of a build of several ms

  std::array<std::atomic<std::uint32_t>, kClasses> shares_;
  std::array<std::atomic<std::uint32_t>, kClasses> counts_{};
};

}  // namespace terrace::server
