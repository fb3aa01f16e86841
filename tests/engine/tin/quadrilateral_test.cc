#include "engine/tin/mesh/quadrilateral.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/tin/mesh/height_field.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(Quadrilateral, ComparesShapesByAreasOverDiameters) {
  // Both diagonals of a rectangle give equal shapes.
  const Quadrilateral rectangle{{1, 4, 0, 0}, {2, 0, 2, 0}, {3, 4, 2, 0}, 0};
  EXPECT_EQ(ShapeQualityOf(rectangle).uv, ShapeQualityOf(rectangle).pw);
  // Corners p (0, 0), u (2, 1), w (1, 16), v (0, 1). With the diagonal u-v twice the areas are 2 and 30, in boxes of 2
  // x 1 and 2 x 15. With p-w they are 31 and 1, in boxes of 2 x 16 and 1 x 16.
  const Quadrilateral kite{{1, 2, 1, 0}, {2, 0, 1, 0}, {3, 1, 16, 0}, 0};
  const ShapeQuality quality = ShapeQualityOf(kite);
  EXPECT_EQ(quality.uv, 2 * 30 * (4 * 16 + 2) * (4 * 16 + 1));
  EXPECT_EQ(quality.pw, 31 * 1 * (4 * 2 + 1) * (4 * 15 + 2));
}

TEST(Quadrilateral, HoldsTheLargestCoordinates) {
  const int most = HeightField::kMaxSide - 1;
  const Quadrilateral square{{1, most, 0, 0}, {2, 0, most, 0}, {3, most, most, 0}, 0};
  const double area = static_cast<double>(most) * most;
  EXPECT_DOUBLE_EQ(ShapeQualityOf(square).uv, area * area * 25 * area);
  EXPECT_EQ(ShapeQualityOf(square).uv, ShapeQualityOf(square).pw);
}

TEST(Quadrilateral, NormalAnglesLessWhereThreeCornersAreLevel) {
  // A square with one raised corner: the best diagonal leaves the other three in one triangle.
  const auto lifted = [](float u, float v, float w, float p) {
    return Quadrilateral{{1, 4, 0, u}, {2, 0, 4, v}, {3, 4, 4, w}, p};
  };
  const auto less_along_pw = [](const Quadrilateral& q) { return NormalAnglesOf(q).pw < NormalAnglesOf(q).uv; };
  EXPECT_TRUE(less_along_pw(lifted(9, 0, 0, 0)));
  EXPECT_TRUE(less_along_pw(lifted(0, 9, 0, 0)));
  EXPECT_FALSE(less_along_pw(lifted(0, 0, 9, 0)));
  EXPECT_FALSE(less_along_pw(lifted(0, 0, 0, 9)));
  EXPECT_NEAR(NormalAnglesOf(lifted(4, 8, 12, 0)).uv, 0, 1e-15);  // a plane
  EXPECT_NEAR(NormalAnglesOf(lifted(4, 8, 12, 0)).pw, 0, 1e-15);
}

TEST(Quadrilateral, NormalAnglesByTheAngleBetweenNormals) {
  // A square of 2 x 2 whose sides slope by 1 in 1 from the diagonal p-w: normals (1, -1, 1) and (-1, 1, 1).
  const Quadrilateral roof{{1, 2, 0, -2}, {2, 0, 2, -2}, {3, 2, 2, 0}, 0};
  EXPECT_NEAR(NormalAnglesOf(roof).pw, 1 - -1.0 / 3, 1e-15);
  // Along u-v: (-1, -1, 1) and (1, 1, 1).
  EXPECT_NEAR(NormalAnglesOf(roof).uv, 1 - -1.0 / 3, 1e-15);
  // Rounded planes never have a negative angle.
  Random random(1);
  for (int i = 0; i < 100000; ++i) {
    const auto height = [a = random.Unit() * 3, b = random.Unit() * 3](int x, int y) {
      return static_cast<float>(std::round((a * x + b * y) * 1024) / 1024);
    };
    const int x = 1000 + random.Below(2000), y = 1000 + random.Below(2000);
    const NormalAngles angles =
        NormalAnglesOf({{1, x, 0, height(x, 0)}, {2, 0, y, height(0, y)}, {3, x, y, height(x, y)}, 0});
    ASSERT_GE(angles.uv, 0);
    ASSERT_GE(angles.pw, 0);
  }
}

}  // namespace
}  // namespace terrace::tin
