#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/tin/scan/triangle_spans.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

// The largest distance of all samples; negative if there is none.
double WorstDistance(const HeightField& field, const std::array<Corner, 3>& corners) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Plane plane(sorted);
  double worst = -1;
  ForEachInnerSpan(sorted, plane.doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    for (int x = first; x <= last; ++x) {
      worst = std::max(worst, std::abs(plane.At(x, plane.AtRow(y)) - static_cast<double>(field.At(x, y))));
    }
  });
  return worst;
}

TEST(SamplesAreWithin, AgreesWithTheWorstSample) {
  Random random(1);
  for (int trial = 0; trial < 3000; ++trial) {
    const HeightField field = NoiseField(2 + random.Below(20), 2 + random.Below(20), random.Next());
    std::array<Corner, 3> corners = RandomTriangle(random, field);
    if (random.Below(2) == 0) std::swap(corners[0], corners[1]);  // in any order
    const double worst = WorstDistance(field, corners);
    if (worst < 0) {
      EXPECT_TRUE(SamplesAreWithin(field, corners, -1));
      continue;
    }
    EXPECT_TRUE(SamplesAreWithin(field, corners, worst * (1 + 1e-9)));
    EXPECT_FALSE(SamplesAreWithin(field, corners, worst * (1 - 1e-9)));
    EXPECT_FALSE(SamplesAreWithin(field, corners, -1));
  }
}

TEST(SamplesAreWithin, IsExactOnWholeMetres) {
  // The distance is a third of a metre: 1 / 3 in double is below one third, its successor above.
  const HeightField field = MakeField(5, 4, [](int x, int y) { return x == 2 && y == 2 ? 1.f : 0.f; });
  const std::array<Corner, 3> corners = {Corner{1, 1, 0}, {4, 1, 0}, {2, 3, 1}};  // (2, 2) lies at 1 / 2
  EXPECT_TRUE(SamplesAreWithin(field, corners, 0.5));
  EXPECT_FALSE(SamplesAreWithin(field, corners, std::nextafter(0.5, 0)));
  const std::array<Corner, 3> thirds = {Corner{1, 0, 0}, {4, 1, 1}, {1, 3, 0}};  // (2, 1) and (3, 1) at 1/3 and 2/3
  const HeightField flat = MakeField(5, 4, [](int, int) { return 0.f; });
  EXPECT_TRUE(SamplesAreWithin(flat, thirds, std::nextafter(2.0 / 3, 1)));
  EXPECT_FALSE(SamplesAreWithin(flat, thirds, std::nextafter(2.0 / 3, 0)));
}

TEST(SamplesAreWithin, SkipsVoidsCornersAndTheBorder) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const HeightField field = MakeField(5, 5, [&](int x, int y) {
    return x == 1 && y == 1 ? nan : y == 0 || x == 0 ? 1e30f : 0.f;
  });
  EXPECT_TRUE(SamplesAreWithin(field, {Corner{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, 0));
}

}  // namespace
}  // namespace terrace::tin
