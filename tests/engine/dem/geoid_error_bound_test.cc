// The distance of tiles from samples of a source above a geoid never exceeds the bound, whatever the curvature of the
// geoid.
#include "engine/bound/geoid_error_bound.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/dem/geoid_grids.h"

namespace terrace::dem {
namespace {

constexpr double kArcSecond = 1 / 3600.0;

// The largest distance of the source's samples, made ellipsoidal by PROJ, from the surface between a tile's nodes.
double LargestError(const TileHeights& tile, const geo::TileKey& key, const RasterSpec& raster, const Geoid& geoid) {
  const Geoid::Reader exact(geoid);
  const geo::Lattice& lattice = tile.lattice;
  const double step = lattice.StepDegrees();
  const double west = lattice.Longitude(lattice.FirstColumn(key)), south = lattice.Latitude(lattice.FirstRow(key));
  double largest = 0;
  for (int row = 0; row < raster.height; ++row) {
    for (int column = 0; column < raster.width; ++column) {
      const Position at{raster.geo_transform[0] + (column + 0.5) * raster.geo_transform[1],
                        raster.geo_transform[3] + (row + 0.5) * raster.geo_transform[5]};
      const double x = (at.x - west) / step, y = (at.y - south) / step;
      const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
      if (i < 0 || j < 0 || i >= lattice.cells || j >= lattice.cells) continue;
      const double u = x - i, v = y - j;
      const double surface = (tile.At(i, j) * (1 - u) + tile.At(i + 1, j) * u) * (1 - v) +
                             (tile.At(i, j + 1) * (1 - u) + tile.At(i + 1, j + 1) * u) * v;
      largest = std::max(largest, std::abs(raster.value(column, row) + exact.At(at) - surface));
    }
  }
  return largest;
}

// Level ground of 1000 m above a geoid with steps of half a second. A summit of 30 m is at a grid node that lattice
// nodes may miss.
TEST(GeoidErrorBound, HoldsASummitBetweenNodes) {
  const TempDir dir;
  const std::string grid = WriteGtx(
      dir, "spike.gtx",
      {.west = 7, .south = 45, .step = kArcSecond / 2, .columns = 801, .rows = 801, .value = [](int column, int row) {
         return column == 401 && row == 397 ? 70.0f : 40.0f;
       }});
  const auto geoid = Geoid::OfGrid(grid, {7.05, 45.05});
  ASSERT_TRUE(geoid) << geoid.error().message;
  // A sample is on the summit.
  RasterSpec raster{.width = 300, .height = 300};
  raster.geo_transform = {7 + (401 - 2 * 150 - 1) * kArcSecond / 2,  kArcSecond, 0,
                          45 + (397 + 2 * 150 + 1) * kArcSecond / 2, 0,          -kArcSecond};
  raster.value = [](int, int) { return 1000.0; };
  const auto source = OpenOrFail(WriteRaster(dir, raster), {.source = {.vertical = grid}});
  ASSERT_NE(source, nullptr);
  const Geoid::Reader exact(**geoid);
  double largest = 0;
  for (int level = 0; level <= source->max_level(); ++level) {
    for (const geo::TileKey& key : SomeTiles(*source, level, 60)) {
      const auto tile = source->Read(key);
      ASSERT_TRUE(tile);
      const geo::Lattice& lattice = tile->lattice;
      for (int j = 0; j <= lattice.cells; ++j) {
        for (int i = 0; i <= lattice.cells; ++i) {
          const Position at{lattice.Longitude(lattice.FirstColumn(key) + i),
                            lattice.Latitude(lattice.FirstRow(key) + j)};
          const double east = (at.x - raster.geo_transform[0]) / kArcSecond;
          const double south = (raster.geo_transform[3] - at.y) / kArcSecond;
          if (east < 0 || south < 0 || east > raster.width || south > raster.height) continue;
          ASSERT_NEAR(tile->At(i, j), 1000 + exact.At(at), 0.002) << geo::ToString(key);
        }
      }
      const double error = LargestError(*tile, key, raster, **geoid);
      EXPECT_GE(tile->source_error_m, error) << geo::ToString(key);
      if (level > 8) {
        EXPECT_LE(tile->source_error_m, error + 30.1) << geo::ToString(key);
      }
      largest = std::max(largest, error);
    }
  }
  EXPECT_GT(largest, 25) << "the summit lies between nodes of some level";
}

// EGM96 at the shallow levels of a global raster, poles included.
TEST(GeoidErrorBound, IsNeverBelowTheTruthAndLittleAboveItOnEgm96) {
  const TempDir dir;
  RasterSpec raster{.width = 1440, .height = 720};
  raster.geo_transform = {-180, 0.25, 0, 90, 0, -0.25};
  raster.value = [](int, int) { return 100.0; };
  const auto source = OpenOrFail(WriteRaster(dir, raster), {.source = {.vertical = "egm96"}});
  ASSERT_NE(source, nullptr);
  const auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
  ASSERT_TRUE(geoid);
  for (int level = 0; level <= std::min(source->max_level(), 4); ++level) {
    for (const geo::TileKey& key : SomeTiles(*source, level, 12)) {
      const auto tile = source->Read(key);
      ASSERT_TRUE(tile);
      const double error = LargestError(*tile, key, raster, **geoid);
      EXPECT_GE(tile->source_error_m, error) << geo::ToString(key);
      // Between samples the error of a bilinear geoid may be larger than at samples. Steps of level 0 are three steps
      // of its grid, so the lowest and the highest node around count there.
      EXPECT_LE(tile->source_error_m, 3 * error + (level == 0 ? 30 : 6)) << geo::ToString(key);
    }
  }
}

}  // namespace
}  // namespace terrace::dem
