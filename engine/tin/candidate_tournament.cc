#include "engine/tin/candidate_tournament.h"

#include <algorithm>

namespace terrace::tin {

void CandidateTournament::Set(std::uint32_t slot, const Candidate& candidate) {
  if (slot >= candidates_.size()) Grow(slot + std::size_t{1});
  candidates_[slot] = candidate;
  // A slot that neither led its block nor takes the lead now changes no winner. A stale block is played anyway.
  const std::size_t block = slot / kFanOut;
  const std::uint32_t leader = levels_[0].winners[block];
  if (leader == slot || Beats(slot, leader)) MarkStale(levels_[0], block);
}

std::uint32_t CandidateTournament::Winner() {
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    Level& level = levels_[i];
    for (const std::uint32_t block : level.stale_blocks) {
      // Even an unchanged winner may hold a new candidate: the level above has to look again.
      level.winners[block] = Play(i, block);
      level.is_stale[block] = 0;
      if (i + 1 < levels_.size()) MarkStale(levels_[i + 1], block / kFanOut);
    }
    level.stale_blocks.clear();
  }
  return levels_.back().winners.front();
}

void CandidateTournament::Grow(std::size_t slots) {
  candidates_.resize(slots);
  std::size_t blocks = slots;
  for (std::size_t i = 0; i == 0 || blocks > 1; ++i) {
    blocks = (blocks + kFanOut - 1) / kFanOut;
    if (i == levels_.size()) levels_.emplace_back();
    Level& level = levels_[i];
    for (std::size_t block = level.winners.size(); block < blocks; ++block) {
      std::size_t first_slot = block;
      for (std::size_t k = 0; k <= i; ++k) first_slot *= kFanOut;
      level.winners.push_back(static_cast<std::uint32_t>(first_slot));
      level.is_stale.push_back(0);
      MarkStale(level, block);
    }
  }
}

void CandidateTournament::MarkStale(Level& level, std::size_t block) {
  if (level.is_stale[block]) return;
  level.is_stale[block] = 1;
  level.stale_blocks.push_back(static_cast<std::uint32_t>(block));
}

bool CandidateTournament::Beats(std::uint32_t slot, std::uint32_t other) const {
  const Candidate &a = candidates_[slot], &b = candidates_[other];
  return Precedes(a, b) || (a == b && slot < other);
}

std::uint32_t CandidateTournament::Play(std::size_t level, std::size_t block) const {
  const std::size_t players = level == 0 ? candidates_.size() : levels_[level - 1].winners.size();
  const std::size_t first = block * kFanOut, last = std::min(first + kFanOut, players);
  const auto player = [&](std::size_t i) {
    return level == 0 ? static_cast<std::uint32_t>(i) : levels_[level - 1].winners[i];
  };
  std::uint32_t winner = player(first);
  for (std::size_t i = first + 1; i < last; ++i) {
    // Players come in ascending slots, so an equal candidate keeps the smaller one.
    if (Precedes(candidates_[player(i)], candidates_[winner])) winner = player(i);
  }
  return winner;
}

}  // namespace terrace::tin
