// The queue of greedy insertion: one candidate per triangle slot, and which one comes first.
//
// Most candidates are replaced before their turn comes, so only the foremost are kept in order: those at or above a
// threshold. One sweep over all errors finds and sorts them; what comes to the threshold later goes into a heap beside
// them. What stays below costs one store, and an entry whose slot has changed since is dropped when its turn comes. When
// none is left, the next sweep lowers the threshold. No back pointers from the slots, and the order is exact: larger
// error first, then smaller index of the sample.
//
// Errors are kept as floats, rounded up: the largest is never understated, and errors that differ by less are ordered by
// their samples.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/candidate.h"

namespace terrace::tin {

class CandidateQueue {
 public:
  static constexpr std::uint32_t kNoSlot = 0xFFFFFFFF;

  CandidateQueue();

  // Slots that were never set hold no candidate.
  void Set(std::uint32_t slot, const Candidate& candidate) {
    if (slot >= errors_.size()) Grow(slot + std::size_t{1});
    const float error = RoundUp(candidate.error);
    errors_[slot] = error;
    samples_[slot] = candidate.sample;
    if (error >= threshold_) Push(slot);
  }

  // The slot whose candidate precedes all others; kNoSlot when there is no candidate at all.
  std::uint32_t Winner();
  // A slot whose candidate is likely to win after `ahead` others; kNoSlot if unknown.
  std::uint32_t Upcoming(std::size_t ahead) const {
    return run_begin_ + ahead < run_.size() ? run_[run_begin_ + ahead].slot : kNoSlot;
  }
  float error(std::uint32_t slot) const { return errors_[slot]; }
  std::uint32_t sample(std::uint32_t slot) const { return samples_[slot]; }

  // The smallest float that is not below a non-negative error.
  static float RoundUp(double error) {
    const auto nearest = static_cast<float>(error);
    if (static_cast<double>(nearest) >= error) return nearest;
    return std::bit_cast<float>(std::bit_cast<std::uint32_t>(nearest) + 1);
  }

 private:
  struct Entry {
    std::uint64_t order;  // non-negative floats compare like their bits: those, then the complement of the sample
    std::uint32_t slot;
  };
  struct IsBehind {
    bool operator()(const Entry& a, const Entry& b) const { return a.order < b.order; }
  };

  void Grow(std::size_t slots);
  void Push(std::uint32_t slot);
  bool Refill();
  std::uint64_t OrderOf(std::uint32_t slot) const {
    return std::uint64_t{std::bit_cast<std::uint32_t>(errors_[slot])} << 32 | ~samples_[slot];
  }

  std::vector<float> errors_;           // by slot; 0: no candidate
  std::vector<std::uint32_t> samples_;  // by slot
  float threshold_;                     // every current candidate at or above it is in the run or in the heap
  double step_ = 0.9;                   // the next threshold as a fraction of the largest error
  std::vector<Entry> run_;              // found by the last sweep, foremost first
  std::size_t run_begin_ = 0;
  std::vector<Entry> heap_;  // later ones
};

}  // namespace terrace::tin
