#include "engine/tin/sagitta.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(SagittaBound, IsZeroOnFlatGround) {
  EXPECT_EQ(SagittaBound({}, {Corner{0, 0, 0}, Corner{8, 0, 0}, Corner{0, 8, 0}}), 0);
}

TEST(SagittaBound, IsAQuarterOfTheSquaredHypotenuseAtARightAngle) {
  const Curvature curvature{std::vector<double>(9, 100.0), 100.0, 5.0};
  EXPECT_DOUBLE_EQ(SagittaBound(curvature, {Corner{0, 0, 0}, Corner{6, 0, 0}, Corner{0, 8, 0}}), 100 * 100.0 / 4 / 10);
}

TEST(SagittaBound, UsesTheLongestRowOfTheTriangle) {
  Curvature curvature{std::vector<double>(9, 1.0), 1.0, 0.5};
  curvature.east_m2[3] = 4;
  curvature.east_m2[7] = 100;
  EXPECT_DOUBLE_EQ(SagittaBound(curvature, {Corner{0, 2, 0}, Corner{6, 2, 0}, Corner{0, 6, 0}}), (36 * 4 + 16) / 4.0);
}

// With h(p) = |p|^2 / 2R, a triangle's plane is above the ground by at most its sagitta.
TEST(SagittaBound, BoundsTheDepthUnderEveryTriangle) {
  constexpr double kEast = 90, kNorth = 110, kRadius = 6.4e6;
  const Curvature curvature{std::vector<double>(65, kEast * kEast), kNorth * kNorth, kRadius};
  const auto ground = [&](int x, int y) { return (x * kEast * x * kEast + y * kNorth * y * kNorth) / (2 * kRadius); };
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    std::array<Corner, 3> corners;
    for (Corner& corner : corners) {
      corner = {random.Below(65), random.Below(65), 0};
      corner.z = ground(corner.x, corner.y);
    }
    const Plane plane(SortedByRow(corners));
    if (plane.doubled_area == 0) continue;
    double deepest = 0;
    for (int k = 0; k < 200; ++k) {
      double u = random.Unit(), v = random.Unit();
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const double x = corners[0].x + u * (corners[1].x - corners[0].x) + v * (corners[2].x - corners[0].x);
      const double y = corners[0].y + u * (corners[1].y - corners[0].y) + v * (corners[2].y - corners[0].y);
      const double on_plane =
          plane.origin.z + plane.per_column * (x - plane.origin.x) + plane.per_row * (y - plane.origin.y);
      deepest = std::max(deepest, on_plane - (x * kEast * x * kEast + y * kNorth * y * kNorth) / (2 * kRadius));
    }
    ASSERT_LE(deepest, SagittaBound(curvature, corners) + 1e-9);
  }
}

}  // namespace
}  // namespace terrace::tin
