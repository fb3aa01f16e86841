#include "engine/tin/scan/triangle_spans.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "engine/tin/mesh/predicates.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

SamplePosition PositionOf(const Corner& corner) {
  return {static_cast<std::uint16_t>(corner.x), static_cast<std::uint16_t>(corner.y)};
}

// 2: strictly inside, 1: on an edge, 0: outside, a corner, or on the field's border.
int CoverageOf(const HeightField& field, const std::array<Corner, 3>& corners, int x, int y) {
  if (x == 0 || y == 0 || x == field.width() - 1 || y == field.height() - 1) return 0;
  const SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
  int coverage = 2;
  for (unsigned i = 0; i < 3; ++i) {
    if (PositionOf(corners[i]) == p) return 0;
    const std::int64_t side = Orientation(PositionOf(corners[i]), PositionOf(corners[(i + 1) % 3]), p);
    if (side < 0) return 0;
    if (side == 0) coverage = 1;
  }
  return coverage;
}

TEST(TriangleSpans, VisitsExactlyTheClosedTriangleInRowMajorOrder) {
  Random random(1);
  for (int i = 0; i < 3000; ++i) {
    const int width = 2 + random.Below(20), height = 2 + random.Below(20);
    const HeightField field = NoiseField(width, height, static_cast<std::uint64_t>(i));
    const std::array<Corner, 3> sorted = SortedByRow(RandomTriangle(random, field));
    std::vector<std::pair<int, int>> expected, visited;
    const std::array<Corner, 3> counter_clockwise =
        Plane(sorted).doubled_area > 0 ? sorted : std::array<Corner, 3>{sorted[0], sorted[2], sorted[1]};
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (CoverageOf(field, counter_clockwise, x, y) > 0) expected.emplace_back(y, x);
      }
    }
    ForEachInnerSpan(sorted, Plane(sorted).doubled_area, width, height, [&](int y, int first, int last) {
      ASSERT_LE(first, last);
      for (int x = first; x <= last; ++x) visited.emplace_back(y, x);
    });
    ASSERT_EQ(visited, expected);
  }
}

TEST(EdgeCrossing, IsExactForTheLongestEdges) {
  constexpr int kLast = HeightField::kMaxSide - 1;
  Random random(2);
  for (int i = 0; i < 20000; ++i) {
    Corner low{random.Below(kLast + 1), random.Below(kLast / 2), 0},
        high{random.Below(kLast + 1), kLast - random.Below(kLast / 2), 0};
    if (i % 3 == 0) low.x = 0, high.x = kLast;
    if (i % 3 == 1) low.x = kLast, high.x = 0;
    const EdgeCrossing crossing(low, high);
    const int y = low.y + random.Below(high.y - low.y + 1);
    const std::int64_t dy = high.y - low.y, n = low.x * dy + std::int64_t{y - low.y} * (high.x - low.x);
    ASSERT_EQ(crossing.Floor(y), n / dy);
    ASSERT_EQ(crossing.Ceil(y), (n + dy - 1) / dy);
  }
}

// In floating point, 49 times the reciprocal of 49 is below 1; with such quotients rounding could lose a sample.
TEST(EdgeCrossing, IsExactWhereAnEdgeMeetsSamples) {
  for (int dy = 1; dy < HeightField::kMaxSide; dy += 1 + dy / 500) {
    for (const int x : {1, 49, 4097, HeightField::kMaxSide - 1}) {
      const EdgeCrossing vertical({x, 0, 0}, {x, dy, 0}), rising({0, 0, 0}, {x, dy, 0});
      ASSERT_EQ(vertical.Floor(dy), x) << dy;
      ASSERT_EQ(vertical.Ceil(dy / 2), x) << dy;
      ASSERT_EQ(rising.Floor(dy), x) << dy;
      ASSERT_EQ(rising.Ceil(dy), x) << dy;
    }
  }
}

TEST(SquaredDistances, CountsEdgesHalf) {
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    const HeightField field = StepField(2 + random.Below(14), 2 + random.Below(14), 3, static_cast<std::uint64_t>(i));
    const std::array<Corner, 3> corners = RandomTriangle(random, field);
    const Plane plane(SortedByRow(corners));
    double squares = 0;
    for (int y = 0; y < field.height(); ++y) {
      for (int x = 0; x < field.width(); ++x) {
        const double distance = plane.At(x, plane.AtRow(y)) - static_cast<double>(field.At(x, y));
        squares += CoverageOf(field, corners, x, y) * 0.5 * distance * distance;
      }
    }
    ASSERT_NEAR(SquaredDistances(field, corners), squares, 1e-9 * (1 + squares));
  }
}

TEST(SquaredDistances, SkipsVoids) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const HeightField field = MakeField(5, 5, [&](int x, int y) {
    return x == 2 && y == 1 ? nan : x == 3 && y == 1 ? 7.f : 0.f;
  });
  EXPECT_EQ(SquaredDistances(field, {Corner{0, 0, 0}, Corner{4, 0, 0}, Corner{4, 4, 0}}), 49);
}

}  // namespace
}  // namespace terrace::tin
