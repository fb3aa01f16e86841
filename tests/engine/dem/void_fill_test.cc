#include "engine/mosaic/void_fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "engine/mosaic/feather_weights.h"

namespace terrace::dem {
namespace {

const float kVoid = std::nanf("");

TEST(FillVoids, InterpolatesBetweenTheRims) {
  // One row: only the pair along the row exists.
  const std::vector<float> row = {0, kVoid, kVoid, kVoid, 8};
  const GridWindow window{0, 0, 5, 1};
  EXPECT_EQ(FillVoids(row, window, window, 4), (std::vector<float>{0, 2, 4, 6, 8}));
  const std::vector<float> open = FillVoids(row, window, window, 3);
  EXPECT_TRUE(std::isnan(open[1]) && std::isnan(open[2]) && std::isnan(open[3]));
}

TEST(FillVoids, NeedsRimsOnBothSides) {
  const std::vector<float> row = {5, kVoid, kVoid};
  const GridWindow window{0, 0, 3, 1};
  EXPECT_TRUE(std::isnan(FillVoids(row, window, window, 64)[1]));
}

TEST(FillVoids, ReproducesAPlane) {
  const GridWindow window{0, 0, 30, 30};
  std::vector<float> heights;
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x)
      heights.push_back(x > 8 && x < 20 && y > 10 && y < 25 ? kVoid : static_cast<float>(3 * x - 2 * y));
  }
  const std::vector<float> filled = FillVoids(heights, window, window, 20);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) EXPECT_NEAR(filled[static_cast<std::size_t>(30 * y + x)], 3 * x - 2 * y, 1e-4);
  }
}

// A row at a time, a window has too few voids to mark those that cannot be bridged.
TEST(FillVoids, IsTheSameForManyVoidsAndForFew) {
  constexpr int kColumns = 70, kRows = 50;
  std::mt19937 random(8);
  const GridWindow whole{0, 0, kColumns, kRows};
  int bridged = 0, left = 0;
  for (const unsigned scarcity : {2U, 20U, 200U, 1500U}) {
    for (const int gap : {2, 5, 16, 64}) {
      std::vector<float> heights(kColumns * kRows, kVoid);
      for (float& height : heights) {
        if (random() % scarcity == 0) height = static_cast<float>(random() % 1000) / 7;
      }
      const std::vector<float> filled = FillVoids(heights, whole, whole, gap);
      for (int row = 0; row < kRows; ++row) {
        const std::vector<float> alone = FillVoids(heights, whole, {0, row, kColumns, 1}, gap);
        for (int column = 0; column < kColumns; ++column) {
          const float a = filled[static_cast<std::size_t>(row * kColumns + column)];
          const float b = alone[static_cast<std::size_t>(column)];
          ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << column << " " << row << " " << gap;
          (std::isnan(a) ? left : bridged) += 1;
        }
      }
    }
  }
  EXPECT_GT(bridged, 1000);
  EXPECT_GT(left, 1000);
}

TEST(FillVoids, DoesNotDependOnTheWindow) {
  constexpr int kSide = 60, kGap = 9;
  std::mt19937 random(3);
  std::vector<float> heights(kSide * kSide);
  for (float& height : heights) height = random() % 3 == 0 ? static_cast<float>(random() % 1000) / 7 : kVoid;
  const GridWindow whole{0, 0, kSide, kSide};
  const std::vector<float> truth = FillVoids(heights, whole, whole, kGap);
  const GridWindow core{20, 25, 12, 10},
      wide{core.column - kGap, core.row - kGap, core.columns + 2 * kGap, core.rows + 2 * kGap};
  std::vector<float> part;
  for (std::int64_t r = 0; r < wide.rows; ++r) {
    for (std::int64_t c = 0; c < wide.columns; ++c) {
      part.push_back(heights[static_cast<std::size_t>((wide.row + r) * kSide + wide.column + c)]);
    }
  }
  const std::vector<float> filled = FillVoids(part, wide, core, kGap);
  for (std::int64_t r = 0; r < core.rows; ++r) {
    for (std::int64_t c = 0; c < core.columns; ++c) {
      const float a = filled[static_cast<std::size_t>(r * core.columns + c)];
      const float b = truth[static_cast<std::size_t>((core.row + r) * kSide + core.column + c)];
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b)));
    }
  }
}

// The nearest void or place outside of `wide`, found among all of them.
TEST(FeatherWeights, AreDistancesToTheNearestVoid) {
  std::mt19937 random(5);
  for (const int one_in : {3, 40, 100000}) {
    const GridWindow wide{-7, 3, 41, 33}, core{1, 9, 27, 20};
    std::vector<float> heights(static_cast<std::size_t>(wide.columns * wide.rows));
    for (float& height : heights) height = random() % static_cast<unsigned>(one_in) == 0 ? kVoid : 5;
    for (const auto& [column_step, row_step] : {std::pair(30.0, 30.0), std::pair(17.0, 31.0)}) {
      const double length = 210;
      const std::vector<float> weights = FeatherWeights(heights, wide, core, column_step, row_step, length);
      for (std::int64_t r = 0; r < core.rows; ++r) {
        for (std::int64_t c = 0; c < core.columns; ++c) {
          double nearest = length;
          for (std::int64_t y = -20; y < wide.rows + 20; ++y) {
            for (std::int64_t x = -20; x < wide.columns + 20; ++x) {
              const bool is_inside = x >= 0 && x < wide.columns && y >= 0 && y < wide.rows;
              if (is_inside && !std::isnan(heights[static_cast<std::size_t>(y * wide.columns + x)])) continue;
              const double east = static_cast<double>(core.column - wide.column + c - x) * column_step;
              const double south = static_cast<double>(core.row - wide.row + r - y) * row_step;
              nearest = std::min(nearest, std::hypot(east, south));
            }
          }
          ASSERT_NEAR(weights[static_cast<std::size_t>(r * core.columns + c)], nearest / length, 1e-6)
              << one_in << ' ' << c << ' ' << r;
        }
      }
    }
  }
}

}  // namespace
}  // namespace terrace::dem
