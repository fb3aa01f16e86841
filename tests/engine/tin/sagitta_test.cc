#include "engine/tin/sagitta.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "engine/tin/mesh/plane.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(Sagitta, IsZeroOnFlatGround) {
  EXPECT_TRUE(Sagitta({}, 9).is_flat());
  EXPECT_EQ(Sagitta({}, 9).Bound({0, 0}, {8, 0}, {0, 8}), 0);
}

TEST(Sagitta, IsAQuarterOfTheSquaredHypotenuseAtARightAngle) {
  const Sagitta sagitta({std::vector<double>(9, 100.0), 100.0, 5.0}, 9);
  EXPECT_DOUBLE_EQ(sagitta.Bound({0, 0}, {6, 0}, {0, 8}), 100 * 100.0 / 4 / 10);
  EXPECT_EQ(sagitta.Bound({6, 0}, {0, 8}, {0, 0}), sagitta.Bound({0, 0}, {6, 0}, {0, 8}));
}

TEST(Sagitta, UsesTheWidestRowOfTheTriangle) {
  const Sagitta sagitta({{1, 2, 3, 4, 9, 7, 5, 2, 1}, 1.0, 0.5}, 9);
  EXPECT_DOUBLE_EQ(sagitta.Bound({0, 2}, {6, 2}, {0, 6}), (36 * 9 + 16) / 4.0);
  EXPECT_DOUBLE_EQ(sagitta.Bound({0, 0}, {6, 0}, {0, 3}), (36 * 4 + 9) / 4.0);
  EXPECT_DOUBLE_EQ(sagitta.Bound({0, 6}, {6, 6}, {0, 8}), (36 * 5 + 4) / 4.0);
}

TEST(SagittaDeathTest, RefusesRowsThatWidenTwice) {
  EXPECT_DEATH(Sagitta({{1, 2, 1, 2}, 1.0, 0.5}, 4), "check failed");
  EXPECT_DEATH(Sagitta({{1, 2, 1}, 1.0, 0.5}, 4), "check failed");
}

// With h(p) = |p|^2 / 2R, a triangle's plane is above the ground by at most its sagitta.
TEST(Sagitta, BoundsTheDepthUnderEveryTriangle) {
  constexpr double kEast = 90, kNorth = 110, kRadius = 6.4e6;
  const Sagitta sagitta({std::vector<double>(65, kEast * kEast), kNorth * kNorth, kRadius}, 65);
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
    const auto at = [&](std::size_t k) -> SamplePosition {
      return {static_cast<std::uint16_t>(corners[k].x), static_cast<std::uint16_t>(corners[k].y)};
    };
    ASSERT_LE(deepest, sagitta.Bound(at(0), at(1), at(2)) + 1e-9);
  }
}

}  // namespace
}  // namespace terrace::tin
