#include "engine/mosaic/void_fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
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

// The definition, void by void.
float Bridged(const std::vector<float>& heights, int columns, int rows, int column, int row, int max_gap) {
  const auto steps_along = [&](int x, int y) {
    for (int steps = 1;; ++steps) {
      const int c = column + steps * x, r = row + steps * y;
      if (c < 0 || c >= columns || r < 0 || r >= rows) return 0;
      if (!std::isnan(heights[static_cast<std::size_t>(r * columns + c)])) return steps;
    }
  };
  const auto height_at = [&](int c, int r) { return double{heights[static_cast<std::size_t>(r * columns + c)]}; };
  double sum = 0, weights = 0;
  for (const auto& [x, y] : {std::pair(1, 0), std::pair(0, 1), std::pair(1, 1), std::pair(1, -1)}) {
    const int ahead = steps_along(x, y), behind = steps_along(-x, -y);
    if (ahead == 0 || behind == 0 || ahead + behind > max_gap) continue;
    const double share = static_cast<double>(behind) / (ahead + behind);
    const double height = share * height_at(column + ahead * x, row + ahead * y) +
                          (1 - share) * height_at(column - behind * x, row - behind * y);
    const double weight = 1 / std::pow((ahead + behind) * std::hypot(x, y), 2);
    sum += weight * height;
    weights += weight;
  }
  return weights == 0 ? kVoid : static_cast<float>(sum / weights);
}

TEST(FillVoids, IsTheMeanOfPairsByDefinition) {
  std::mt19937 random(8);
  int bridged = 0, left = 0;
  for (const auto& [columns, rows] : {std::pair(70, 50), std::pair(1, 90), std::pair(90, 1), std::pair(33, 2)}) {
    const GridWindow whole{0, 0, columns, rows};
    for (const double share_of_voids : {0.03, 0.5, 0.95, 0.995, 0.9993}) {
      for (const int gap : {2, 5, 16, 64, 4096}) {
        std::vector<float> heights(static_cast<std::size_t>(columns * rows), kVoid);
        for (float& height : heights) {
          if (static_cast<double>(random()) > share_of_voids * static_cast<double>(random.max()))
            height = static_cast<float>(random() % 1000) / 7;
        }
        const std::vector<float> filled = FillVoids(heights, whole, whole, gap);
        for (int i = 0; i < columns * rows; ++i) {
          const float was = heights[static_cast<std::size_t>(i)], now = filled[static_cast<std::size_t>(i)];
          const float truth = std::isnan(was) ? Bridged(heights, columns, rows, i % columns, i / columns, gap) : was;
          ASSERT_EQ(std::isnan(now), std::isnan(truth)) << i << " of " << columns << ", gap " << gap;
          if (std::isnan(now)) continue;
          ASSERT_NEAR(now, truth, std::isnan(was) ? 1e-4 : 0) << i << " of " << columns << ", gap " << gap;
          bridged += std::isnan(was) ? 1 : 0;
        }
        left += static_cast<int>(std::ranges::count_if(filled, [](float height) { return std::isnan(height); }));
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
