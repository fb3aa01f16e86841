#include "fly/scene/view.h"

#include <gtest/gtest.h>

#include <cmath>

namespace terrace::fly {
namespace {

Volume BallAt(const View& view, const geo::Vec3& direction, double distance_m, double radius_m) {
  return Sphere{view.position() + direction * distance_m, radius_m};
}

TEST(View, SeesWhatIsBetweenItsSides) {
  const View view({{10, 46, 3000}, 30, -20}, {1920, 1080, 60});
  for (const double x : {-0.98, 0.0, 0.98}) {
    for (const double y : {-0.98, 0.0, 0.98}) EXPECT_TRUE(view.Sees(BallAt(view, view.RayThrough(x, y), 1e4, 1)));
  }
  for (const double off : {-1.02, 1.02}) {
    EXPECT_FALSE(view.Sees(BallAt(view, view.RayThrough(off, 0), 1e4, 1)));
    EXPECT_FALSE(view.Sees(BallAt(view, view.RayThrough(0, off), 1e4, 1)));
  }
  EXPECT_FALSE(view.Sees(BallAt(view, view.direction() * -1, 1e4, 1)));
  EXPECT_TRUE(view.Sees(BallAt(view, view.direction() * -1, 1e4, 2e4)));
}

TEST(View, HeadingAndPitchTurnTheCamera) {
  const View east({{0, 0, 0}, 90, 0}, {}), down({{0, 0, 0}, 0, -90}, {});
  EXPECT_NEAR(east.direction().y, 1, 1e-12);   // at longitude 0 east is +y
  EXPECT_NEAR(down.direction().x, -1, 1e-12);  // and down is -x
}

TEST(View, ErrorsShrinkWithDistance) {
  const View view({{0, 0, 0}, 0, 0}, {1920, 1080, 60});
  const double focal_px = 960 / std::tan(geo::ToRadians(30));
  EXPECT_NEAR(view.ErrorInPixels(10, 1000), focal_px / 100, 1e-9);
  EXPECT_NEAR(view.ErrorInPixels(10, 2000), focal_px / 200, 1e-9);
}

TEST(View, FogHidesWhatIsFar) {
  EXPECT_DOUBLE_EQ(FogDensity(0), 2e-5);
  EXPECT_DOUBLE_EQ(FogDensity(2e6), 0);
  EXPECT_NEAR(FogDensity((800.749 + 1275.6501) / 2), 1.5e-4, 1e-12);
  EXPECT_FALSE(IsHiddenByFog(1e7, 0));
  EXPECT_FALSE(IsHiddenByFog(27.2 / 1e-4, 1e-4));
  EXPECT_TRUE(IsHiddenByFog(27.4 / 1e-4, 1e-4));
}

}  // namespace
}  // namespace terrace::fly
