#include "engine/geo/mercator_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "engine/geo/ellipsoid.h"

namespace terrace::geo {
namespace {

TEST(MercatorGrid, LatitudesAreThoseOfTheFormula) {
  for (int i = 0; i <= 100'000; ++i) {
    const double y = i / 100'000.0;
    const double expected = ToDegrees(std::atan(std::sinh(std::numbers::pi * (1 - 2 * y))));
    ASSERT_NEAR(MercatorLatitude(y), expected, 1e-12) << y;  // 0.1 micrometres
  }
  EXPECT_NEAR(MercatorLatitude(0), kMercatorLatitude, 1e-12);
  EXPECT_EQ(MercatorLatitude(0.5), 0);
}

// The exact bits, because they must not depend on the machine.
TEST(MercatorGrid, LatitudesHaveTheseBits) {
  EXPECT_EQ((MercatorGrid{3}.Latitude(700)), 0x1.8a99d98ef5d25p+5);
  EXPECT_EQ((MercatorGrid{12}.Latitude(1)), 0x1.54344f74f04eap+6);
}

TEST(MercatorGrid, IsSymmetricAndFallsFromTheNorth) {
  const MercatorGrid grid{4};
  for (std::int64_t row = 0; row < grid.rows(); ++row) {
    ASSERT_EQ(grid.Latitude(row), -grid.Latitude(grid.rows() - 1 - row)) << row;
    ASSERT_LT(grid.Latitude(row + 1), grid.Latitude(row)) << row;
  }
}

TEST(MercatorGrid, PixelCentresOfALevelHalveThoseAbove) {
  EXPECT_EQ((MercatorGrid{0}.Longitude(0)), -180 + 360.0 / 512);
  EXPECT_EQ((MercatorGrid{2}.Longitude(512)), 360.0 / 2048);
  EXPECT_EQ((MercatorGrid{1}.StepDegrees()), (MercatorGrid{0}.StepDegrees()) / 2);
  // Pixels of deep levels are distinct.
  const MercatorGrid deep{24};
  EXPECT_GT(deep.Latitude(deep.rows() / 3), deep.Latitude(deep.rows() / 3 + 1));
}

}  // namespace
}  // namespace terrace::geo
