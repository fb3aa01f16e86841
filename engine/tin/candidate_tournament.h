// The queue of greedy insertion: one candidate per triangle slot, and which slot's candidate comes first.
//
// A max tournament of fan-out 64. Level 0 holds, for each block of 64 slots, the slot that wins it; each higher level
// does the same for 64 blocks below. Changing a slot costs nothing but a mark, unless it takes the lead of its block at
// once; marked blocks are played again when somebody asks for the winner. No back pointers into the slots, as a heap
// needs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/candidate.h"

namespace terrace::tin {

class CandidateTournament {
 public:
  // Slots that were never set hold no candidate.
  void Set(std::uint32_t slot, const Candidate& candidate);

  // The slot whose candidate precedes all others, the smallest slot if several hold the same one (a sample on an edge).
  // 0 when there is no candidate at all. Precondition: some slot was set.
  std::uint32_t Winner();
  const Candidate& At(std::uint32_t slot) const { return candidates_[slot]; }

 private:
  static constexpr std::size_t kFanOut = 64;

  struct Level {
    std::vector<std::uint32_t> winners;  // by block: the slot that wins it
    std::vector<std::uint8_t> is_stale;  // by block
    std::vector<std::uint32_t> stale_blocks;
  };

  void Grow(std::size_t slots);
  void MarkStale(Level& level, std::size_t block);
  bool Beats(std::uint32_t slot, std::uint32_t other) const;
  std::uint32_t Play(std::size_t level, std::size_t block) const;

  std::vector<Candidate> candidates_;  // by slot
  std::vector<Level> levels_;          // levels_[0] has a block per 64 slots, the last one a single block
};

}  // namespace terrace::tin
