#include "engine/tin/mesh/candidate_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

struct Expected {
  float error = 0;
  std::uint32_t sample = kNoSample;
  std::size_t slot = 0;
};

// The first candidate in the queue's order, by testing all; of equal ones the last.
Expected Foremost(const std::vector<Candidate>& candidates) {
  Expected best;
  for (std::size_t slot = 0; slot < candidates.size(); ++slot) {
    const Candidate& candidate = candidates[slot];
    const float error = CandidateQueue::RoundUp(candidate.error);
    if (error > best.error || (error == best.error && error > 0 && candidate.sample <= best.sample)) {
      best = {error, candidate.sample, slot};
    }
  }
  return best;
}

testing::AssertionResult Agrees(CandidateQueue& queue, const std::vector<Candidate>& candidates) {
  const Expected expected = Foremost(candidates);
  const std::uint32_t winner = queue.Winner();
  if (winner == CandidateQueue::kNoSlot) {
    if (expected.error == 0) return testing::AssertionSuccess();
    return testing::AssertionFailure() << "no winner instead of " << expected.error;
  }
  if (queue.error(winner) == expected.error && queue.sample(winner) == expected.sample && winner == expected.slot) {
    return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << "slot " << winner << " with " << queue.error(winner) << " instead of "
                                     << expected.error;
}

TEST(CandidateQueue, AgreesWithALinearSearch) {
  for (const bool integers : {true, false}) {
    Random random(1);
    CandidateQueue queue;
    std::vector<Candidate> candidates;
    for (int round = 0; round < 20000; ++round) {
      auto slot = static_cast<std::uint32_t>(candidates.size());
      if (slot > 0 && random.Below(3) > 0) slot = static_cast<std::uint32_t>(random.Below(static_cast<int>(slot)));
      if (slot == candidates.size()) candidates.emplace_back();
      Candidate candidate;
      // Few different errors and samples, so many ties. Errors decrease as in a run, but not monotonically.
      if (random.Below(5) > 0) {
        const double error = 1 + (20000 - round) / 2000 + random.Below(4) * 0.5;
        candidate = {integers ? error : error * random.Unit(), static_cast<std::uint32_t>(1 + random.Below(50))};
      }
      candidates[slot] = candidate;
      queue.Set(slot, candidate);
      if (round % 7 == 0) {
        ASSERT_TRUE(Agrees(queue, candidates)) << round;
      }
    }
  }
}

// Like the star of an insertion, here of up to 80 triangles, with many or few ties.
TEST(CandidateQueue, TakesManyAtOnce) {
  for (const int most_y : {9, 0x7FFF}) {
    Random random(7);
    CandidateQueue queue;
    std::vector<Candidate> candidates;
    for (int round = 0; round < 3000; ++round) {
      const auto first = static_cast<std::uint32_t>(random.Below(static_cast<int>(candidates.size()) + 1));
      const auto count = static_cast<std::uint32_t>(1 + random.Below(random.Below(20) == 0 ? 80 : 8));
      candidates.resize(std::max<std::size_t>(candidates.size(), first + count));
      std::vector<std::uint32_t> slots;
      for (std::uint32_t slot = first + count; slot-- > first;) {
        slots.push_back(slot);
        candidates[slot] = {1 + (3000 - round) / 300 + random.Below(4) * 0.5,
                            SampleNumber(random.Below(9), random.Below(most_y))};
      }
      queue.Reserve(candidates.size());
      queue.SetAll(slots.data(), slots.size(), [&](std::size_t i) {
        return Candidate{candidates[slots[i]].error, candidates[slots[i]].sample};
      });
      ASSERT_TRUE(Agrees(queue, candidates)) << "round " << round << " of " << most_y;
    }
  }
}

// As in greedy insertion: smaller candidates replace the winner, until nothing is left.
TEST(CandidateQueue, EmptiesInOrder) {
  Random random(2);
  CandidateQueue queue;
  for (std::uint32_t slot = 0; slot < 5000; ++slot) queue.Set(slot, {random.Unit() * 100, slot + 1});
  float before = std::numeric_limits<float>::infinity();
  std::size_t count = 0;
  for (std::uint32_t slot = queue.Winner(); slot != CandidateQueue::kNoSlot; slot = queue.Winner()) {
    ASSERT_LE(queue.error(slot), before);
    before = queue.error(slot);
    queue.Set(slot, {});
    ++count;
  }
  EXPECT_EQ(count, 5000u);
  queue.Set(7, {1, 3});
  EXPECT_EQ(queue.Winner(), 7u);
}

TEST(CandidateQueue, HoldsNoneWhereNothingWasSet) {
  CandidateQueue queue;
  EXPECT_EQ(queue.Winner(), CandidateQueue::kNoSlot);
  queue.Set(200, {});
  EXPECT_EQ(queue.Winner(), CandidateQueue::kNoSlot);
  queue.Set(130, {1, 5});
  EXPECT_EQ(queue.Winner(), 130u);
  queue.Set(130, {});
  EXPECT_EQ(queue.Winner(), CandidateQueue::kNoSlot);
}

TEST(CandidateQueue, OrdersTheSmallestAndTheLargestErrors) {
  CandidateQueue queue;
  queue.Set(0, {1e-310, 1});
  queue.Set(1, {1e-320, 2});
  EXPECT_EQ(queue.Winner(), 0u);
  queue.Set(2, {1e300, 9});
  queue.Set(3, {1e305, 8});
  EXPECT_EQ(queue.Winner(), 3u);  // both errors are too large for a float, so the smaller sample wins
  queue.Set(3, {});
  EXPECT_EQ(queue.Winner(), 2u);
  queue.Set(2, {});
  EXPECT_GT(queue.error(queue.Winner()), 0);
}

// Samples of a tile, for which an entry of a sweep fits into a word, and of the largest fields, for which it does not.
TEST(CandidateQueue, SortsWhatASweepFinds) {
  for (const int most_y : {256, 0x7FFF}) {
    Random random(5);
    CandidateQueue queue;
    std::vector<Candidate> candidates;
    for (std::uint32_t slot = 0; slot < 20000; ++slot) {
      const bool is_tie = slot % 7 == 6;
      candidates.push_back(
          is_tie ? candidates.back()
                 : Candidate{1.8 + 0.15 * random.Unit(), SampleNumber(random.Below(257), random.Below(most_y))});
      queue.Set(slot, candidates.back());
    }
    for (std::size_t left = candidates.size(); left > 19500; --left) {
      ASSERT_TRUE(Agrees(queue, candidates)) << left << " of " << most_y;
      const std::uint32_t winner = queue.Winner();
      candidates[winner] = {};
      queue.Set(winner, {});
    }
  }
}

// Few entries are sorted by another method than many. Tests numbers around the limit, with ties of two, for every
// instruction set.
TEST(CandidateQueue, SortsFewAndMany) {
  ForEachInstructionSet([] {
    Random random(11);
    for (std::uint32_t count = 1; count < 140; ++count) {
      CandidateQueue queue;
      std::vector<Candidate> candidates;
      for (std::uint32_t slot = 0; slot < count; ++slot) {
        const bool is_tie = slot % 5 == 4;
        candidates.push_back(is_tie ? candidates.back()
                                    : Candidate{1.9 + 0.1 * random.Unit(), SampleNumber(random.Below(257), 3)});
        queue.Set(slot, candidates.back());
      }
      for (std::uint32_t left = count; left > 0; --left) {
        ASSERT_TRUE(Agrees(queue, candidates)) << left << " of " << count;
        const std::uint32_t winner = queue.Winner();
        candidates[winner] = {};
        queue.Set(winner, {});
      }
    }
  });
}

TEST(CandidateQueue, RoundsUp) {
  Random random(3);
  for (int i = 0; i < 100000; ++i) {
    const double error = std::ldexp(random.Unit(), random.Below(300) - 160);
    const float rounded = CandidateQueue::RoundUp(error);
    ASSERT_GE(static_cast<double>(rounded), error);
    ASSERT_LT(static_cast<double>(std::nextafter(rounded, 0.0F)), error == 0 ? 1 : error);
  }
  EXPECT_EQ(CandidateQueue::RoundUp(0), 0);
  EXPECT_EQ(CandidateQueue::RoundUp(5), 5);
}

}  // namespace
}  // namespace terrace::tin
