// The queue of greedy insertion: one candidate per triangle slot, and which one comes first.
//
// Most candidates are replaced before their turn comes, so only the foremost are kept in order: those at or above a
// threshold, in a short sorted array, the run. One sweep over all errors finds and sorts them; what comes to the
// threshold later is put where it belongs. What stays below costs one store, and an entry whose slot has changed since
// is dropped when its turn comes. When none is left, the next sweep lowers the threshold; when there are too many, the
// threshold rises. No back pointers from the slots, and the order is exact: larger error first, then smaller number of
// the sample, then, where a sample on an edge is the worst of both of its triangles, the larger slot.
//
// Errors are kept as floats, rounded up: the largest is never understated, and errors that differ by less are ordered
// by their samples.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/spare_blocks.h"

namespace terrace::tin {

class CandidateQueue {
 public:
  static constexpr std::uint32_t kNoSlot = 0xFFFFFFFF;

  explicit CandidateQueue(std::size_t likely_slots = 0);

  // Slots that were never set hold no candidate.
  void Set(std::uint32_t slot, const Candidate& candidate) {
    Reserve(slot + std::size_t{1});
    if (Put(slot, candidate)) Insert(slot);
  }
  // The same for many slots, each of them once: Set(slots[i], candidate(i)). Precondition: there is room for them all.
  template <typename CandidateOf>
  void SetAll(const std::uint32_t* slots, std::size_t count, CandidateOf&& candidate) {
    // Which of them belong into the run is collected without a branch, for it cannot be predicted.
    std::array<std::uint32_t, 64> foremost;
    for (std::size_t first = 0; first < count; first += foremost.size()) {
      std::size_t found = 0;
      for (std::size_t i = first; i < std::min(count, first + foremost.size()); ++i) {
        foremost[found] = slots[i];
        found += Put(slots[i], candidate(i)) ? 1 : 0;
      }
      for (std::size_t i = 0; i < found; ++i) {
        if (errors_[foremost[i]] >= threshold_) Insert(foremost[i]);  // an insertion may have raised the threshold
      }
    }
  }
  // Room for slots below this one.
  void Reserve(std::size_t slots) {
    if (slots > errors_.size()) Grow(slots);
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
    const std::uint32_t above = static_cast<double>(nearest) < error ? 1 : 0;  // added: a branch would be a coin toss
    return std::bit_cast<float>(std::bit_cast<std::uint32_t>(nearest) + above);
  }

 private:
  static constexpr std::size_t kMinWanted = 48;

  struct Entry {
    std::uint64_t order;  // non-negative floats compare like their bits: those, then the complement of the sample
    std::uint32_t slot;
  };
  // Whether the slot belongs into the run.
  bool Put(std::uint32_t slot, const Candidate& candidate) {
    const float error = RoundUp(candidate.error);
    errors_[slot] = error;
    samples_[slot] = candidate.sample;
    return error >= threshold_;
  }
  void Grow(std::size_t slots);
  void Insert(std::uint32_t slot);
  bool Refill();
  bool SweepFrom(float most);
  void SortSwept();
  void SortPairs();
  void Shorten();
  std::uint64_t OrderOf(std::uint32_t slot) const {
    return std::uint64_t{std::bit_cast<std::uint32_t>(errors_[slot])} << 32 | ~samples_[slot];
  }

  LargeArray<float> errors_;           // by slot; 0: no candidate
  LargeArray<std::uint32_t> samples_;  // by slot
  float threshold_;                    // every current candidate at or above it is in the run
  double step_ = 0.9;                  // the next threshold as a fraction of the largest error
  std::vector<Entry> run_;             // foremost first, from run_begin_ on
  std::size_t run_begin_ = 0;
  std::vector<std::uint32_t> swept_;  // slots that the last sweep found, ascending
  std::vector<std::uint64_t> words_;  // of SortSwept, and room for a vector beyond them
  std::size_t wanted_ = kMinWanted;   // entries between two sweeps
  std::size_t entered_ = 0;           // since the last one
};

}  // namespace terrace::tin
