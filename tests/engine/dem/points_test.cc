// Heights at single points, at the full resolution.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <string>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

RasterSpec Steps() {
  RasterSpec spec{.width = 600, .height = 600, .geo_transform = {10, .01, 0, 20, 0, -.01}, .nodata = -9999};
  spec.value = [](int col, int row) { return col == 300 && row == 300 ? -9999.0 : col + 100.0 * row; };
  return spec;
}

// The position of a pixel coordinate in the raster above.
GeoPosition At(double column, double row) { return {10 + column * .01, 20 - row * .01}; }

TEST(Points, AreBilinearBetweenCentres) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()));
  const std::vector<GeoPosition> points = {At(5.5, 7.5), At(6, 7.5), At(5.75, 8.25), At(0, 0), At(.5, 600)};
  const auto heights = source->ReadPoints(points);
  ASSERT_TRUE(heights);
  EXPECT_NEAR((*heights)[0], 5 + 700, .01);
  EXPECT_NEAR((*heights)[1], 5.5 + 700, .01);
  EXPECT_NEAR((*heights)[2], 5.25 + 775, .01);
  EXPECT_NEAR((*heights)[3], 0, .01);  // half a pixel beyond the outermost centres
  EXPECT_NEAR((*heights)[4], 59'900, .1);
}

TEST(Points, AreNothingOutside) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()), {.floor = 7});
  const std::vector<GeoPosition> points = {At(-.01, 5), At(5, 600.01), {-120, 0}, {12, -90}};
  std::vector<std::uint8_t> filled(points.size(), 7);
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, {}, filled);
  ASSERT_TRUE(heights);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_TRUE(std::isnan((*heights)[i])) << i;
}

TEST(Points, AreFilledInSmallVoids) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()), {.floor = 7});
  const std::vector<GeoPosition> points = {At(300.5, 300.5), At(300.01, 300.99), At(299.99, 300.5)};
  std::vector<std::uint8_t> filled(points.size(), 7);
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, {}, filled);
  ASSERT_TRUE(heights);
  EXPECT_NEAR((*heights)[0], 300 + 30'000, .1);
  EXPECT_NEAR((*heights)[1], 299.51 + 30'049, .1);
  EXPECT_NEAR((*heights)[2], 299.49 + 30'000, .1);
  EXPECT_EQ(filled, (std::vector<std::uint8_t>{1, 1, 0}));
}

TEST(Points, NeverShowTheSeaFloorOfACoarseSourceThroughAPinhole) {
  const TempDir dir;
  RasterSpec floor{.width = 40, .height = 40, .geo_transform = {5, .5, 0, 25, 0, -.5}};
  floor.value = [](int, int) { return -4000.0; };
  const auto source = OpenOrFail({{.path = WriteRaster(dir, Steps(), "fine.tif"), .rank = 0},
                                  {.path = WriteRaster(dir, floor, "floor.tif"), .rank = 1}});
  ASSERT_TRUE(source);
  const std::vector<GeoPosition> points = {At(300.5, 300.5), At(300.2, 300.8), At(-5, 300)};
  std::vector<std::uint8_t> filled(points.size());
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, {}, filled);
  ASSERT_TRUE(heights);
  EXPECT_NEAR((*heights)[0], 300 + 30'000, .1);
  EXPECT_NEAR((*heights)[1], 299.7 + 30'030, 10);
  EXPECT_EQ((*heights)[2], -4000) << "beside the fine source";
  EXPECT_EQ(filled, (std::vector<std::uint8_t>{1, 1, 0}));
}

TEST(Points, DoNotDependOnEachOtherOrTheirOrder) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()));
  std::mt19937 random(7);
  std::uniform_real_distribution<double> anywhere(-20, 620);
  std::vector<GeoPosition> points(3000);
  for (GeoPosition& point : points) point = At(anywhere(random), anywhere(random));
  const auto together = source->ReadPoints(points);
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  std::vector<GeoPosition> shuffled;
  for (const std::size_t i : order) shuffled.push_back(points[i]);
  const auto apart = source->ReadPoints(shuffled);
  ASSERT_TRUE(together && apart);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const float a = (*together)[order[i]], b = (*apart)[i];
    ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << order[i];
  }
  for (std::size_t i = 0; i < 40; ++i) {
    const auto alone = source->ReadPoints({&points[i], 1});
    ASSERT_TRUE(alone);
    ASSERT_TRUE((*alone)[0] == (*together)[i] || std::isnan((*alone)[0])) << i;
  }
}

TEST(Points, GoRoundTheEarth) {
  const TempDir dir;
  RasterSpec spec{.width = 360, .height = 180, .geo_transform = {0, 1, 0, 90, 0, -1}};
  spec.value = [](int col, int) { return col < 180 ? col : 360.0 - col; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  const std::vector<GeoPosition> points = {{0, 0}, {-.25, 0}, {180, 10}, {-180, 10}, {-179.75, -89.9}};
  const auto heights = source->ReadPoints(points);
  ASSERT_TRUE(heights);
  EXPECT_NEAR((*heights)[0], .5, .001);  // between columns 359 and 0
  EXPECT_NEAR((*heights)[1], .75, .001);
  EXPECT_NEAR((*heights)[2], 179.5, .001);
  EXPECT_EQ((*heights)[3], (*heights)[2]);
  EXPECT_NEAR((*heights)[4], 179.75, .3);
}

// Corners are written with few digits, but the remainder between the last and the first column is not a gap.
TEST(Points, LieNowhereBetweenTheEndsOfAGlobalRaster) {
  const TempDir dir;
  RasterSpec spec{.width = 360, .height = 180, .geo_transform = {-180, 359.9985 / 360, 0, 90, 0, -1}};
  spec.value = [](int col, int) { return col < 180 ? col : 359 - col; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  std::vector<GeoPosition> points;
  for (const double longitude : {179.9, 179.998, 179.9987, 179.999, 180.0, -180.0, -179.9995, -179.99}) {
    points.push_back({longitude, 10});
  }
  const auto heights = source->ReadPoints(points);
  ASSERT_TRUE(heights);
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_NEAR((*heights)[i], 0, .01) << points[i].longitude;

  spec.value = [](int col, int) { return col < 180 ? col : 1000 + col; };  // a slope through the seam
  const auto slope = OpenOrFail(WriteRaster(dir, spec, "slope.tif"));
  ASSERT_NE(slope, nullptr);
  const auto on_slope = slope->ReadPoints(points);
  ASSERT_TRUE(on_slope);
  EXPECT_EQ((*on_slope)[4], (*on_slope)[5]) << "180 and -180 degrees";
}

// Eastings that continue beyond the antimeridian, or go around the Earth from the prime meridian.
TEST(Points, OfACylindricalProjectionLieOnBothSidesOfTheAntimeridian) {
  constexpr double kHalfTurn = 20'037'508.342789244;  // of EPSG:3857, metres
  const TempDir dir;
  const auto column_of = [](double longitude) { return longitude / 180 * kHalfTurn; };
  struct Case {
    const char* crs;
    double west, east;  // degrees
  };
  for (const Case& c : {Case{"EPSG:3857", 178, 182},
                        {"EPSG:3857", -182, -178},
                        {"EPSG:3857", 0, 360},
                        {"EPSG:4087", 0, 360},
                        {"EPSG:3857", -180, 180}}) {
    SCOPED_TRACE(std::string(c.crs) + " from " + std::to_string(c.west));
    const double pixel = (column_of(c.east) - column_of(c.west)) / 200;
    RasterSpec spec{.width = 200,
                    .height = 100,
                    .geo_transform = {column_of(c.west), pixel, 0, 50 * pixel, 0, -pixel},
                    .crs = c.crs};
    spec.value = [](int col, int) { return 10.0 * col; };
    const auto source = OpenOrFail(WriteRaster(dir, spec));
    ASSERT_NE(source, nullptr);
    for (const int col : {0, 20, 99, 150, 199}) {
      const double longitude = c.west + (c.east - c.west) * (col + 0.5) / 200;
      const std::vector<GeoPosition> points = {{std::remainder(longitude, 360), 0}};
      const auto heights = source->ReadPoints(points);
      ASSERT_TRUE(heights);
      EXPECT_NEAR((*heights)[0], 10.0 * col, .01) << col;
    }
  }
}

// In rotated rasters any corner may be beyond the antimeridian, and a first row may be beyond the pole.
TEST(Points, BeyondTheAntimeridianAreFoundFromEveryCornerAndRow) {
  constexpr double kDegree = 20'037'508.342789244 / 180;  // of EPSG:4087, metres
  constexpr double kPixel = kDegree / 10;
  const TempDir dir;
  struct Case {
    const char* what;
    std::array<double, 6> geo_transform;
    double column, row;  // of a pixel beyond
  };
  const double west = 177.9 * kDegree;
  for (const Case& c : {Case{"lower left", {west, .2 * kPixel, .9 * kPixel, 0, .9 * kPixel, -.2 * kPixel}, 5, 38},
                        {"lower right", {west, .5 * kPixel, .5 * kPixel, 0, .5 * kPixel, -.6 * kPixel}, 38, 38},
                        {"rows beyond the poles", {0, 9 * kDegree, 0, 95 * kDegree, 0, -4.75 * kDegree}, 30, 20}}) {
    SCOPED_TRACE(c.what);
    RasterSpec spec{.width = 40, .height = 40, .geo_transform = c.geo_transform, .crs = "EPSG:4087"};
    spec.value = [](int col, int row) { return 1000.0 + 10 * col + row; };
    const auto source = OpenOrFail(WriteRaster(dir, spec));
    ASSERT_NE(source, nullptr);
    const auto& t = c.geo_transform;
    const double column = c.column + .5, row = c.row + .5;
    const double longitude = (t[0] + column * t[1] + row * t[2]) / kDegree,
                 latitude = (t[3] + column * t[4] + row * t[5]) / kDegree;
    ASSERT_GT(longitude, 180);
    const std::vector<GeoPosition> points = {{longitude - 360, latitude}};
    const auto heights = source->ReadPoints(points);
    ASSERT_TRUE(heights);
    EXPECT_NEAR((*heights)[0], spec.value(static_cast<int>(c.column), static_cast<int>(c.row)), .01);
  }
}

TEST(Points, StopWhenAsked) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()));
  std::stop_source stop;
  stop.request_stop();
  const std::vector<GeoPosition> points = {At(5, 5)};
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, stop.get_token());
  ASSERT_FALSE(heights);
  EXPECT_EQ(heights.error().code, ErrorCode::kCancelled);
}

TEST(Points, AreNoneForNoPoints) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Steps()));
  const auto heights = source->ReadPoints({});
  ASSERT_TRUE(heights);
  EXPECT_TRUE(heights->empty());
}

}  // namespace
}  // namespace terrace::dem
