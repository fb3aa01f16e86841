#include "fly/scene/volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "fly/scene/view.h"

namespace terrace::fly {
namespace {

geo::TileKey RandomTile(std::mt19937& random, int min_level, int max_level) {
  const int level = std::uniform_int_distribution(min_level, max_level)(random);
  return {level, std::uniform_int_distribution<std::int64_t>(0, geo::TileColumns(level) - 1)(random),
          std::uniform_int_distribution<std::int64_t>(0, geo::TileRows(level) - 1)(random)};
}

GeodeticPoint RandomPointIn(std::mt19937& random, const Region& region) {
  const Rectangle& r = region.rectangle();
  return {std::uniform_real_distribution(r.west, r.east)(random),
          std::uniform_real_distribution(r.south, r.north)(random),
          std::uniform_real_distribution(region.min_height_m(), region.max_height_m())(random)};
}

geo::Vec3 At(const GeodeticPoint& p) { return geo::ToEcef(p.longitude, p.latitude, p.height_m); }

TEST(Volume, RegionsContainTheirPoints) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Region region(RectangleOf(RandomTile(random, 0, 14)), -500, 4000);
    const GeodeticPoint point = RandomPointIn(random, region);
    const geo::Vec3 position = At(point);
    EXPECT_NEAR(std::sqrt(DistanceSquared(Volume(region), position, point)), 0, 1e-3 + 1e-9 * geo::Length(position));
    // A plane through the point leaves it on neither side.
    const geo::Vec3 normal = geo::SurfaceNormal(i * 7 % 360 - 180, i * 3 % 180 - 90);
    EXPECT_FALSE(IsBehind(region, {normal, -geo::Dot(normal, position) + 1}));
  }
}

// Selection would refine too late if a distance were too large.
TEST(Volume, DistancesToRegionsAreLowerBounds) {
  std::mt19937 random(2);
  for (int i = 0; i < 300; ++i) {
    const geo::TileKey key = RandomTile(random, 5, 14);
    const Region region(RectangleOf(key), 0, 3000);
    const Rectangle& r = region.rectangle();
    const double side = r.east - r.west;
    GeodeticPoint camera{r.west + side * std::uniform_real_distribution(-2.0, 3.0)(random),
                         std::clamp(r.south + side * std::uniform_real_distribution(-2.0, 3.0)(random), -89.0, 89.0),
                         std::uniform_real_distribution(-400.0, 20000.0)(random)};
    const geo::Vec3 position = At(camera);
    double nearest = 1e12;
    for (int j = 0; j < 400; ++j)
      nearest = std::min(nearest, geo::Length(At(RandomPointIn(random, region)) - position));
    const double distance = std::sqrt(DistanceSquared(Volume(region), position, camera));
    EXPECT_LE(distance, nearest * 1.01) << geo::ToString(key);
  }
}

// Parallels bend towards the equator: a plane through the corners would cut off the middle of the side.
TEST(Volume, SidesTowardsTheEquatorAreNotCutOff) {
  for (const std::int64_t row : {4, 10, 21, 27}) {
    const Region region(RectangleOf({5, 37, row}), 0, 0);
    const Rectangle& r = region.rectangle();
    const double offset = 1e-4;  // degrees: 11 m
    const GeodeticPoint camera{(r.west + r.east) / 2, row < 16 ? r.north + offset : r.south - offset, 0};
    EXPECT_NEAR(std::sqrt(DistanceSquared(Volume(region), At(camera), camera)), 11.1, 0.2) << row;
  }
}

TEST(Volume, ARegionBelowIsItsHeightAway) {
  const Region region(RectangleOf({8, 300, 180}), 100, 900);
  const Rectangle& r = region.rectangle();
  const GeodeticPoint camera{(r.west + r.east) / 2, (r.south + r.north) / 2, 5900};
  EXPECT_NEAR(std::sqrt(DistanceSquared(Volume(region), At(camera), camera)), 5000, 1e-6);
  EXPECT_TRUE(MeetsVertical(region, camera));
  EXPECT_FALSE(MeetsVertical(region, {r.east + 1, r.south, 5900}));
}

// From 170 E to 170 W, and the same region with longitudes that do not wrap.
TEST(Volume, RegionsMayCrossTheAntimeridian) {
  const Region across({170, -20, 190, 0}, 0, 3000), beside({0, -20, 20, 0}, 0, 3000);
  for (double longitude = -180; longitude <= 180; longitude += 1) {
    const GeodeticPoint camera{longitude, -30, 5000};
    const GeodeticPoint turned{std::remainder(longitude - 170, 360.0), -30, 5000};
    EXPECT_EQ(MeetsVertical(across, {longitude, -10, 0}), longitude >= 170 || longitude <= -170) << longitude;
    EXPECT_NEAR(std::sqrt(DistanceSquared(Volume(across), At(camera), camera)),
                std::sqrt(DistanceSquared(Volume(beside), At(turned), turned)), 1e-3)
        << longitude;
    const GeodeticPoint above{longitude, -10, 5000};
    if (MeetsVertical(across, above)) {
      EXPECT_NEAR(std::sqrt(DistanceSquared(Volume(across), At(above), above)), 2000, 1e-6) << longitude;
    }
  }
}

TEST(Volume, SpheresAreMeasuredFromTheirSurface) {
  const Volume sphere = Sphere{{7e6, 0, 0}, 1000};
  EXPECT_DOUBLE_EQ(DistanceSquared(sphere, {7e6, 3000, 0}, {}), 2000.0 * 2000.0);
  EXPECT_EQ(DistanceSquared(sphere, {7e6, 10, 0}, {}), 0);
  EXPECT_TRUE(MeetsVertical(sphere, {0, 0, 1e6}));
  EXPECT_FALSE(MeetsVertical(sphere, {180, 0, 1e6}));
  EXPECT_TRUE(MeetsVertical(Volume(Sphere{{0, 0, 0}, 6.4e6}), {180, 0, 1e6}));
}

}  // namespace
}  // namespace terrace::fly
