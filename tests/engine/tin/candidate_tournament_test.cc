#include "engine/tin/candidate_tournament.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(CandidateTournament, AgreesWithALinearSearch) {
  Random random(1);
  CandidateTournament tournament;
  std::vector<Candidate> candidates;
  for (int round = 0; round < 30000; ++round) {
    std::uint32_t slot = static_cast<std::uint32_t>(candidates.size());
    if (slot > 0 && random.Below(3) > 0) slot = static_cast<std::uint32_t>(random.Below(static_cast<int>(slot)));
    if (slot == candidates.size()) candidates.emplace_back();
    Candidate candidate;
    // Few different errors and samples: many ties. Errors fall, as they do in a run.
    if (random.Below(5) > 0)
      candidate = {1 + (30000 - round) / 3000 + random.Below(4) * 0.5, static_cast<std::uint32_t>(random.Below(50))};
    candidates[slot] = candidate;
    tournament.Set(slot, candidate);
    if (round % 7 != 0) continue;
    std::uint32_t expected = 0;
    for (std::uint32_t i = 1; i < candidates.size(); ++i) {
      if (Precedes(candidates[i], candidates[expected])) expected = i;
    }
    ASSERT_EQ(tournament.Winner(), expected);
    ASSERT_EQ(tournament.At(tournament.Winner()), candidates[expected]);
  }
  EXPECT_GT(candidates.size(), 64u * 64u);
}

TEST(CandidateTournament, HoldsNoneWhereNothingWasSet) {
  CandidateTournament tournament;
  tournament.Set(200, {});
  EXPECT_EQ(tournament.At(tournament.Winner()), Candidate{});
  tournament.Set(130, {1, 5});
  EXPECT_EQ(tournament.Winner(), 130u);
  tournament.Set(130, {});
  EXPECT_EQ(tournament.At(tournament.Winner()).error, 0);
}

}  // namespace
}  // namespace terrace::tin
