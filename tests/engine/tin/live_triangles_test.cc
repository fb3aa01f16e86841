#include "engine/tin/live_triangles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

using Index = InsertionRecord::Index;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

// Random rings of one triangle up to `most`, open and closed. An insertion removes random live triangles.
InsertionRecord RandomRecord(Random& random, std::size_t insertions, int most) {
  InsertionRecord record;
  record.removed.assign(2, InsertionRecord::kNever);
  std::vector<std::size_t> standing = {0, 1};
  for (std::size_t i = 0; i < insertions; ++i) {
    bool is_open = random.Below(4) == 0;
    const int at_most = std::min(most, static_cast<int>(standing.size()) + (is_open ? 1 : 2));
    const std::size_t count = 1 + static_cast<std::size_t>(random.Below(at_most));
    is_open |= count == 1;
    record.sizes.push_back(static_cast<Index>(count | (is_open ? InsertionRecord::kOpen : 0)));
    for (std::size_t k = 0; k < count + (is_open ? 1 : 0); ++k) {
      record.rings.push_back(static_cast<Index>(random.Below(static_cast<int>(4 + i))));
    }
    for (std::size_t k = 0; k < count - (is_open ? 1 : 2); ++k) {
      std::swap(standing[static_cast<std::size_t>(random.Below(static_cast<int>(standing.size())))], standing.back());
      record.removed[standing.back()] = static_cast<Index>(i);
      standing.pop_back();
    }
    for (std::size_t k = 0; k < count; ++k) {
      standing.push_back(record.removed.size());
      record.removed.push_back(InsertionRecord::kNever);
    }
  }
  return record;
}

Triangles OneByOne(const InsertionRecord& record, std::size_t insertions) {
  Triangles made = {{0, 1, 2}, {2, 3, 0}};
  std::size_t ring = 0;
  for (std::size_t i = 0; i < insertions; ++i) {
    const bool is_open = (record.sizes[i] & InsertionRecord::kOpen) != 0;
    const std::size_t count = record.sizes[i] & static_cast<Index>(~InsertionRecord::kOpen),
                      vertices = count + (is_open ? 1 : 0);
    for (std::size_t k = 0; k < count; ++k) {
      made.push_back(
          {record.rings[ring + k], record.rings[ring + (k + 1) % vertices], static_cast<std::uint32_t>(4 + i)});
    }
    ring += vertices;
  }
  Triangles standing;
  for (std::size_t t = 0; t < made.size(); ++t) {
    if (record.removed[t] >= insertions) standing.push_back(made[t]);
  }
  return standing;
}

// Every prefix, so that records end at all positions.
TEST(LiveTriangles, AreThoseThatNothingHasRemovedYet) {
  Random random(1);
  for (const int most : {2, 6, 8, 9, 40}) {
    for (const std::size_t length : {0u, 1u, 7u, 60u}) {
      // A copy has no spare memory at its ends, so AddressSanitizer reports reads beyond.
      const InsertionRecord made = RandomRecord(random, length, most), record = made;
      for (std::size_t insertions = 0; insertions <= length; ++insertions) {
        const Triangles expected = OneByOne(record, insertions);
        ForEachInstructionSet([&] { EXPECT_EQ(LiveTriangles(record, insertions), expected); });
      }
    }
  }
}

}  // namespace
}  // namespace terrace::tin
