#include "engine/geo/ellipsoid.h"

#include <gtest/gtest.h>

namespace terrace::geo {
namespace {

TEST(Ellipsoid, HasItsAxesWhereTheyBelong) {
  EXPECT_EQ(ToEcef(0, 0, 0), (Vec3{kSemiMajorAxis, 0, 0}));
  EXPECT_EQ(ToEcef(90, 0, 10), (Vec3{0, kSemiMajorAxis + 10, 0}));
  EXPECT_NEAR(kSemiMinorAxis, kSemiMajorAxis * (1 - kFlattening), 1e-9);
  EXPECT_NEAR(ToEcef(33, 90, 5).z, kSemiMinorAxis + 5, 1e-8);
}

TEST(Ellipsoid, ThePolesAreOnePointWhateverTheLongitude) {
  for (const double longitude : {-180.0, -77.3, 0.0, 45.0, 179.99}) {
    EXPECT_EQ(ToEcef(longitude, 90, 100), ToEcef(0, 90, 100));
    EXPECT_EQ(SurfaceNormal(longitude, -90), (Vec3{0, 0, -1}));
    EXPECT_EQ(SurfaceNormal(longitude, 90), (Vec3{0, 0, 1}));
  }
}

TEST(Ellipsoid, TheAntimeridianIsOneLine) {
  for (const double latitude : {-60.0, 0.0, 12.5}) EXPECT_EQ(ToEcef(-180, latitude, 7), ToEcef(180, latitude, 7));
}

TEST(Ellipsoid, PointsOnTheSurfaceSatisfyItsEquation) {
  for (double latitude = -89; latitude < 90; latitude += 7.3) {
    for (double longitude = -175; longitude < 180; longitude += 31.7) {
      const Vec3 p = ToEcef(longitude, latitude, 0);
      const double radial = (p.x * p.x + p.y * p.y) / (kSemiMajorAxis * kSemiMajorAxis);
      EXPECT_NEAR(radial + p.z * p.z / (kSemiMinorAxis * kSemiMinorAxis), 1, 1e-12);
      const Vec3 up = SurfaceNormal(longitude, latitude);
      EXPECT_NEAR(Length(up), 1, 1e-12);
      EXPECT_LT(Length(ToEcef(longitude, latitude, 1000) - (p + up * 1000)), 1e-6);
    }
  }
}

TEST(Ellipsoid, DegreesHaveTheirLengthsOnTheGround) {
  EXPECT_NEAR(MetresPerDegreeEast(0), 111319.4908, 1e-3);
  EXPECT_NEAR(MetresPerDegreeNorth(0), 110574.2758, 1e-3);
  EXPECT_EQ(MetresPerDegreeEast(90), 0);
  for (const double latitude : {-70.0, -20.0, 0.0, 45.0, 80.0}) {
    constexpr double kStep = 1e-4;
    const double east = Length(ToEcef(kStep, latitude, 0) - ToEcef(0, latitude, 0)) / kStep;
    const double north = Length(ToEcef(0, latitude + kStep, 0) - ToEcef(0, latitude, 0)) / kStep;
    EXPECT_NEAR(MetresPerDegreeEast(latitude), east, 0.05);
    EXPECT_NEAR(MetresPerDegreeNorth(latitude), north, 0.05);
  }
}

TEST(Vec3, Normalizes) {
  EXPECT_EQ(Normalized({0, 3, 0}), (Vec3{0, 1, 0}));
  EXPECT_EQ(Normalized({0, 0, 0}), (Vec3{0, 0, 0}));
  EXPECT_EQ(Cross({1, 0, 0}, {0, 1, 0}), (Vec3{0, 0, 1}));
}

}  // namespace
}  // namespace terrace::geo
