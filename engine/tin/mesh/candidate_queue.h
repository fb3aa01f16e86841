// The queue of greedy insertion: one candidate per triangle slot, and the first candidate of all.
//
// Most candidates are replaced before their turn. Therefore only the candidates with errors at or above a threshold are
// kept in order, in a short sorted array, the run. A sweep over all errors finds and sorts them. A later candidate at
// or above the threshold is inserted into the run; one below it costs a single store. An entry whose slot has changed
// since is dropped when its turn comes. If the run is empty, the next sweep lowers the threshold; if it is too long,
// the threshold rises. Slots need no back pointers. The order is exact: larger error first, then the smaller sample
// number, then the larger slot, if a sample on an edge is the worst of both of its triangles.
//
// Errors are kept as floats, rounded up: the largest error is never understated. Errors that round to the same float
// are ordered by their samples.
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
  // Set(slots[i], candidate(i)) for all i. Preconditions: the slots are distinct and reserved.
  template <typename CandidateOf>
  void SetAll(const std::uint32_t* slots, std::size_t count, CandidateOf&& candidate) {
    // Collects the slots that belong into the run without a branch, which would be mispredicted.
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

  // The slot whose candidate precedes all others; kNoSlot if there is no candidate.
  std::uint32_t Winner();
  // The slot whose turn is likely to come after `ahead` others; kNoSlot if unknown.
  std::uint32_t Upcoming(std::size_t ahead) const {
    return run_begin_ + ahead < run_.size() ? run_[run_begin_ + ahead].slot : kNoSlot;
  }
  float error(std::uint32_t slot) const { return errors_[slot]; }
  std::uint32_t sample(std::uint32_t slot) const { return samples_[slot]; }

  // The smallest float that is not below a non-negative error.
  static float RoundUp(double error) {
    const auto nearest = static_cast<float>(error);
    const std::uint32_t above = static_cast<double>(nearest) < error ? 1 : 0;  // no branch: mispredicted
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
  bool SweepFrom(float max_error);
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
  std::size_t entered_ = 0;           // entries since the last sweep
};

}  // namespace terrace::tin
