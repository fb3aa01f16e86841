#include "engine/common/range_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace terrace::dem {
namespace {

TEST(RangeTable, ContainsEverySampleOfAnyBox) {
  constexpr int kWidth = 1500, kHeight = 900;
  std::mt19937 random(1);
  std::vector<float> heights(kWidth * kHeight);
  for (float& height : heights) height = static_cast<float>(random() % 5000);
  for (int i = 0; i < 200; ++i) heights[random() % heights.size()] = std::nanf("");
  RangeTable table(kWidth, kHeight);
  table.AddWindow(0, 0, kWidth, kHeight, heights.data());
  table.Finish();
  for (int i = 0; i < 300; ++i) {
    const int x0 = static_cast<int>(random() % kWidth),
              x1 = std::min(kWidth - 1, x0 + static_cast<int>(random() % 700));
    const int y0 = static_cast<int>(random() % kHeight),
              y1 = std::min(kHeight - 1, y0 + static_cast<int>(random() % 700));
    BlockRange truth;
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) truth.Add(heights[static_cast<std::size_t>(y * kWidth + x)]);
    }
    const BlockRange range = table.Query(x0, y0, x1, y1);
    EXPECT_LE(range.min, truth.min);
    EXPECT_GE(range.max, truth.max);
    EXPECT_TRUE(range.has_voids || !truth.has_voids);
  }
}

TEST(RangeTable, AnswersFromTheBlocksOfTheBox) {
  std::vector<float> heights(256 * 256);
  for (int i = 0; i < 256 * 256; ++i) heights[static_cast<std::size_t>(i)] = static_cast<float>(i % 256 / 64);
  RangeTable table(256, 256);
  table.AddWindow(0, 0, 256, 256, heights.data());
  table.Finish();
  EXPECT_EQ(table.Query(70, 70, 120, 120).min, 1);
  EXPECT_EQ(table.Query(70, 70, 120, 120).max, 1);
  EXPECT_EQ(table.Query(60, 0, 70, 0).max, 1);
  EXPECT_GT(table.Query(300, 0, 400, 10).min, table.Query(300, 0, 400, 10).max);
}

}  // namespace
}  // namespace terrace::dem
