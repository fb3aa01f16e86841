// Heights at the pixels of Web Mercator tiles.
#include <cmath>
#include <numbers>

#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

struct Spot {
  std::int64_t column, row;
};

// The pixel that contains a position, by the textbook formula.
Spot PixelAt(int depth, double longitude, double latitude) {
  const double size = std::ldexp(256, depth), radians = latitude * std::numbers::pi / 180;
  const double y = (1 - std::asinh(std::tan(radians)) / std::numbers::pi) / 2;
  return {static_cast<std::int64_t>((longitude + 180) / 360 * size), static_cast<std::int64_t>(y * size)};
}

Spot CentreOf(const ElevationModel& model, int depth) {
  const GeoBounds& b = model.info().bounds;
  return PixelAt(depth, (b.west + (b.east < b.west ? b.east + 360 : b.east)) / 2, (b.south + b.north) / 2);
}

TEST(Mercator, ReproducesAPlane) {
  const TempDir dir;
  RasterSpec spec{.width = 400, .height = 300, .type = "Float64", .geo_transform = {10, .01, 0, 60, 0, -.01}};
  spec.value = [](int col, int row) { return 100 * (10 + (col + .5) * .01) - 30 * (60 - (row + .5) * .01); };
  const auto source = OpenOrFail(WriteRaster(dir, spec), {.floor = -9});
  EXPECT_GE(source->info().max_mercator_depth, 8);
  int inside = 0;
  for (int depth = 2; depth <= source->info().max_mercator_depth; ++depth) {  // averaging included
    const geo::MercatorGrid grid{depth};
    const Spot centre = PixelAt(depth, 12, 58.5);
    const NodeWindow window{centre.column - 20, centre.row - 20, 41, 41};
    const auto heights = source->ReadMercator(depth, window);
    ASSERT_TRUE(heights);
    const double margin = std::max(.02, 2 * grid.StepDegrees());
    for (int k = 0; k < window.columns * window.rows; ++k) {
      const double x = grid.Longitude(window.column + k % window.columns);
      const double y = grid.Latitude(window.row + k / window.columns);
      if (x < 10 + margin || x > 14 - margin || y > 60 - margin || y < 57 + margin) continue;
      ASSERT_NEAR((*heights)[static_cast<std::size_t>(k)], 100 * x - 30 * y, .0006) << depth;
      ++inside;
    }
  }
  EXPECT_GT(inside, 4000);
}

TEST(Mercator, IsTheFloorOutsideTheSource) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {10, 1, 0, 60, 0, -1}};
  spec.value = [](int, int) { return 500.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec), {.floor = -7});
  const auto world = source->ReadMercator(0, {0, 0, 256, 256});
  ASSERT_TRUE(world);
  EXPECT_EQ((*world)[0], -7);
  const Spot inside = PixelAt(0, 18, 52);
  EXPECT_EQ((*world)[static_cast<std::size_t>(inside.row * 256 + inside.column)], 500);
}

TEST(Mercator, IsAsDeepAsTheSourceIsFine) {
  const TempDir dir;
  // One arc second at the equator: 360 / 256 / 2^12 degrees are too coarse, 2^13 are not.
  const RasterSpec second{.geo_transform = {0, 1 / 3600.0, 0, 0, 0, -1 / 3600.0}};
  EXPECT_EQ(OpenOrFail(WriteRaster(dir, second, "second.tif"))->info().max_mercator_depth, 13);
  const RasterSpec world{.width = 36, .height = 18, .geo_transform = {-180, 10, 0, 90, 0, -10}};
  EXPECT_EQ(OpenOrFail(WriteRaster(dir, world, "world.tif"))->info().max_mercator_depth, 1);
}

// A pixel has the same bits in every window: in two halves and in the whole, for every kind of CRS.
TEST(Mercator, PixelsDoNotDependOnTheirTile) {
  for (const std::string& name : RealRasters()) {
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    for (const int depth : {source->info().max_mercator_depth, std::max(1, source->info().max_mercator_depth - 3)}) {
      Spot at = CentreOf(*source, depth);
      const std::int64_t last = geo::MercatorGrid{depth}.rows() - 61;
      at.row = std::clamp<std::int64_t>(at.row - 30, 0, last);
      const auto whole = source->ReadMercator(depth, {at.column, at.row, 70, 60});
      const auto part = source->ReadMercator(depth, {at.column + 33, at.row + 17, 20, 31});
      ASSERT_TRUE(whole && part) << name;
      for (int j = 0; j < 31; ++j) {
        for (int i = 0; i < 20; ++i) {
          ASSERT_EQ((*whole)[static_cast<std::size_t>((j + 17) * 70 + i + 33)],
                    (*part)[static_cast<std::size_t>(j * 20 + i)])
              << name << " depth " << depth;
        }
      }
    }
  }
}

// At the source's own resolution a pixel is the height at its position.
TEST(Mercator, AgreesWithPoints) {
  for (const char* const name : {"srtm3_N46E008_swiss_alps.tif", "bigtujunga_30m_utm11.tif"}) {
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path, {.max_void_gap = 0});  // points are never filled
    const int depth = source->info().max_mercator_depth;
    const geo::MercatorGrid grid{depth};
    const Spot at = CentreOf(*source, depth);
    const auto heights = source->ReadMercator(depth, {at.column, at.row, 64, 64});
    ASSERT_TRUE(heights);
    std::vector<GeoPosition> points;
    for (int k = 0; k < 64 * 64; ++k)
      points.push_back({grid.Longitude(at.column + k % 64), grid.Latitude(at.row + k / 64)});
    const auto exact = source->ReadPoints(points);
    ASSERT_TRUE(exact);
    int valid = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (std::isnan((*exact)[k])) continue;
      ASSERT_NEAR((*heights)[k], (*exact)[k], .002) << name;
      ++valid;
    }
    EXPECT_GT(valid, 3000) << name;
  }
}

}  // namespace
}  // namespace terrace::dem
