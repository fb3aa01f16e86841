#include "engine/tin/mesh/height_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "engine/tin/mesh/height_scans.h"
#include "tests/engine/tin/instruction_sets.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(HeightField, RefusesWhatCannotBeTriangulated) {
  EXPECT_FALSE(HeightField::Make(1, 5, std::vector<float>(5)));
  EXPECT_FALSE(HeightField::Make(5, 1, std::vector<float>(5)));
  EXPECT_FALSE(HeightField::Make(-2, -2, std::vector<float>(4)));
  EXPECT_FALSE(HeightField::Make(HeightField::kMaxSide + 1, 2, std::vector<float>(2 * (HeightField::kMaxSide + 1))));
  EXPECT_FALSE(HeightField::Make(2, 2, std::vector<float>(5)));
  const Result<HeightField> all_void = HeightField::Make(2, 2, std::vector<float>(4, kVoid));
  ASSERT_FALSE(all_void);
  EXPECT_EQ(all_void.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(all_void.error().message, "all 2 x 2 samples of the height field are void: at least one needs a height");
}

TEST(HeightField, TakesInfinitiesForVoids) {
  const float infinity = std::numeric_limits<float>::infinity();
  const Result<HeightField> field = HeightField::Make(2, 2, {1, infinity, -infinity, kVoid});
  ASSERT_TRUE(field);
  EXPECT_TRUE(field->has_voids());
  EXPECT_EQ(field->At(0, 0), 1);
  EXPECT_TRUE(std::isnan(field->At(1, 0)) && std::isnan(field->At(0, 1)) && std::isnan(field->At(1, 1)));
  EXPECT_FALSE(NoiseField(2, 2, 1).has_voids());
}

TEST(HeightField, KnowsTheRangeOfWhatIsFinite) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity(), kLargest = std::numeric_limits<float>::max();
  constexpr std::array<float, 6> kOdd = {kVoid, kInfinity, -kInfinity, kLargest, -kLargest, -0.0F};
  ForEachInstructionSet([&] {
    Random random(3);
    for (int round = 0; round < 500; ++round) {
      const int odd_percent = random.Below(4) * 30;
      std::vector<float> heights(static_cast<std::size_t>(random.Below(70)));
      for (float& height : heights) {
        height = random.Below(100) < odd_percent ? kOdd[static_cast<std::size_t>(random.Below(6))]
                                                 : static_cast<float>(random.Below(2000) - 1000);
      }
      std::vector<float> finite;
      std::copy_if(heights.begin(), heights.end(), std::back_inserter(finite),
                   [](float h) { return std::isfinite(h); });
      const std::vector<float> before = heights;
      const ValidHeights range = MarkVoids(heights.data(), heights.size());
      ASSERT_EQ(range.voids, heights.size() - finite.size());
      for (std::size_t i = 0; i < heights.size(); ++i) {
        ASSERT_TRUE(std::isfinite(before[i]) ? heights[i] == before[i] : std::isnan(heights[i]));
      }
      if (finite.empty()) {
        ASSERT_GT(range.lowest, range.highest);
      } else {
        ASSERT_EQ(range.lowest, *std::min_element(finite.begin(), finite.end()));
        ASSERT_EQ(range.highest, *std::max_element(finite.begin(), finite.end()));
      }
    }
  });
}

// Widths of short rows, of rows with padding, and of others, including the smallest.
TEST(HeightField, HasItsRowsWhereverTheyLie) {
  constexpr int kRows = 9;
  for (const int width : {2, 3, 17, 511, 512, 513, 1024, 1025, 1040, 1201, 1280, 2047}) {
    for (const std::size_t room : {0, 32}) {
      std::vector<float> heights;
      heights.reserve(kRows * (static_cast<std::size_t>(width) + room));
      for (int i = 0; i < kRows * width; ++i) heights.push_back(static_cast<float>(i));
      const float* const data = heights.data();
      const Result<HeightField> field = HeightField::Make(width, kRows, std::move(heights));
      ASSERT_TRUE(field);
      // 64 rows must not share a few of a cache's 64 sets of lines.
      std::set<int> sets;
      for (int y = 0; y < 64; ++y) sets.insert(y * field->stride() / 16 % 64);
      EXPECT_TRUE(width < 512 || sets.size() > 16) << width;
      EXPECT_TRUE(room == 0 || width < 512 || field->Row(0) == data) << "copied at " << width;
      for (int y = 0; y < kRows; ++y) {
        for (int x = 0; x < width; ++x) {
          const auto sample = static_cast<float>(y * width + x);
          ASSERT_EQ(field->At(x, y), sample) << width;
          ASSERT_EQ(field->At(PositionOf(SampleNumber(x, y))), sample) << width;
        }
      }
    }
  }
}

TEST(HeightField, FindsTheQuantumOfItsHeights) {
  const auto quantum_of = [](float unit, float odd) {
    return MakeField(9, 7, [&](int x, int y) { return x == 4 && y == 3 ? odd : unit * static_cast<float>(x * 7 - y); })
        .quantum();
  };
  EXPECT_EQ(quantum_of(1, 5), 1);
  EXPECT_EQ(quantum_of(1, kVoid), 1);
  EXPECT_EQ(quantum_of(1, 0.5F), 0x1p-10F);
  EXPECT_EQ(quantum_of(0x1p-10F, 8848), 0x1p-10F);
  EXPECT_EQ(quantum_of(0x1p-14F, 1), 0x1p-14F);
  EXPECT_EQ(quantum_of(1, 0.1F), 0);
  EXPECT_EQ(quantum_of(1, 1e30F), 0);
}

TEST(HeightField, LendsAVoidVertexTheNearestHeight) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const int width = 2 + random.Below(12), height = 2 + random.Below(12), valid_percent = 1 + random.Below(40);
    int valid = 0;
    const HeightField field = MakeField(width, height, [&](int x, int y) {
      const bool last_chance = valid == 0 && x == width - 1 && y == height - 1;
      if (!last_chance && random.Below(100) >= valid_percent) return kVoid;
      ++valid;
      return static_cast<float>(y * width + x);
    });
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        int nearest = std::numeric_limits<int>::max();
        float expected = 0;
        for (int row = 0; row < height; ++row) {
          for (int column = 0; column < width; ++column) {
            const int distance = (column - x) * (column - x) + (row - y) * (row - y);
            if (std::isnan(field.At(column, row)) || distance >= nearest) continue;
            nearest = distance;
            expected = field.At(column, row);
          }
        }
        ASSERT_EQ(field.VertexHeight(x, y), expected);
      }
    }
  }
}

TEST(HeightField, FindsTheNearestHeightAcrossWideVoids) {
  Random random(6);
  for (int i = 0; i < 30; ++i) {
    const int width = 2 + random.Below(400), height = 2 + random.Below(300);
    std::vector<std::pair<int, int>> valid;
    for (int k = 0; k < 6; ++k) valid.push_back({random.Below(width), random.Below(height)});
    valid.push_back({width - 1 - valid[0].first, valid[0].second});  // ties are likely halfway between the two
    std::vector<float> heights(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kVoid);
    for (const auto& [x, y] : valid)
      heights[static_cast<std::size_t>(y * width + x)] = static_cast<float>(y * width + x);
    const Result<HeightField> field = HeightField::Make(width, height, heights);
    ASSERT_TRUE(field);
    for (int k = 0; k < 300; ++k) {
      const int x = k % 3 == 0 ? (width - 1) / 2 : random.Below(width), y = random.Below(height);
      std::pair<int, int> nearest{std::numeric_limits<int>::max(), 0};  // squared distance, index
      for (const auto& [column, row] : valid) {
        nearest = std::min(nearest, {(column - x) * (column - x) + (row - y) * (row - y), row * width + column});
      }
      ASSERT_EQ(field->VertexHeight(x, y), static_cast<float>(nearest.second)) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace terrace::tin
