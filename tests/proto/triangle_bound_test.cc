// The largest error near a triangle is that of the nodes on the inner side of all its sides, on every set of
// instructions.
#include "proto/error/triangle_bound.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"

namespace terrace::proto {
namespace {

TEST(TriangleBound, IsTheLargestErrorOnTheInnerSide) {
  constexpr int kStride = 60, kBehind = 7;
  std::mt19937 random(5);
  const auto pick = [&](int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); };
  for (int round = 0; round < 400; ++round) {
    BoxedTriangle triangle;
    triangle.columns = 1 + pick(40);
    triangle.rows = 1 + pick(round % 2 == 0 ? 12 : 50);  // more rows are clipped strip by strip
    std::vector<float> samples(static_cast<std::size_t>(kStride * triangle.rows + kBehind));
    for (float& sample : samples) sample = static_cast<float>(700 + pick(1000) / 8.0);
    // Whole numbers: the sums are exact, so that no node is between inside and outside.
    for (BoxedTriangle::Side& side : triangle.sides)
      side = {static_cast<float>(pick(120) - 20), static_cast<float>(pick(21) - 10), static_cast<float>(pick(21) - 10)};
    triangle.height = 720.5F;
    triangle.per_column = static_cast<float>((pick(200) - 100) / 64.0);
    triangle.per_row = static_cast<float>((pick(200) - 100) / 64.0);
    double in_box = 0, around = 0;  // with the columns that may count as well
    for (int j = 0; j < triangle.rows; ++j) {
      for (int i = 0; i < triangle.columns + kBehind; ++i) {
        const bool is_inside = std::ranges::all_of(triangle.sides, [&](const BoxedTriangle::Side& side) {
          return side.at + side.per_column * static_cast<float>(i) + side.per_row * static_cast<float>(j) >= 0;
        });
        const double height = triangle.height + double{triangle.per_column} * i + double{triangle.per_row} * j;
        if (!is_inside) continue;
        const double error = std::abs(height - samples[static_cast<std::size_t>(j * kStride + i)]);
        around = std::max(around, error);
        if (i < triangle.columns) in_box = std::max(in_box, error);
      }
    }
    tin::ForEachInstructionSet([&] {
      const double found = LargestInTriangle(triangle, samples.data(), kStride);
      EXPECT_GE(found, in_box - 1e-3) << round;
      EXPECT_LE(found, around + 1e-3) << round;
    });
  }
}

}  // namespace
}  // namespace terrace::proto
