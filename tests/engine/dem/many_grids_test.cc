// Mosaics of distant rasters or around the Earth: their bounds, and shallow tiles of many rasters.
#include <cmath>
#include <utility>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(ManyGrids, BoundsReachAroundTheAntimeridian) {
  const auto bounds = [](const std::vector<std::pair<int, int>>& longitudes) {  // west and east, which may be past 180
    const TempDir dir;
    std::vector<DemFile> files;
    for (const auto& [west, east] : longitudes) {
      RasterSpec spec;
      spec.width = east - west;
      spec.height = 10;
      spec.geo_transform = {static_cast<double>(west), 1, 0, 5, 0, -1};
      files.push_back({WriteRaster(dir, spec, std::to_string(files.size()) + ".tif")});
    }
    const GeoBounds found = OpenOrFail(files)->info().bounds;
    return std::pair(found.west, found.east);
  };
  EXPECT_EQ(bounds({{-179, -170}, {100, 200}}), std::pair(100.0, -160.0)) << "one lies beyond, inside of the other";
  EXPECT_EQ(bounds({{-165, -150}, {170, 200}}), std::pair(170.0, -150.0)) << "one begins beyond, inside of the other";
  EXPECT_EQ(bounds({{-150, -140}, {170, 200}}), std::pair(170.0, -140.0));
  EXPECT_EQ(bounds({{-179, -170}, {170, 178}, {100, 200}}), std::pair(100.0, -160.0));
  EXPECT_EQ(bounds({{-150, -140}, {0, 10}}), std::pair(-150.0, 10.0));
  EXPECT_EQ(bounds({{-100, 120}, {100, 300}}), std::pair(-180.0, 180.0)) << "all around";
}

// Corners of adjacent pieces differ by rounding.
TEST(ManyGrids, PiecesOfTheGlobeHaveItsBounds) {
  for (const int width : {90, 110, 130, 170, 230, 330, 410}) {
    const TempDir dir;
    std::vector<DemFile> files;
    for (int piece = 0; piece < 3; ++piece) {
      const int first = width * piece / 3;
      RasterSpec spec;
      spec.width = width * (piece + 1) / 3 - first;
      spec.height = 20;
      spec.geo_transform = {-180 + first * (360.0 / width), 360.0 / width, 0, 90, 0, -9};
      files.push_back({WriteRaster(dir, spec, std::to_string(piece) + ".tif")});
    }
    const auto source = OpenOrFail(files);
    ASSERT_NE(source, nullptr);
    EXPECT_NEAR(source->info().bounds.west, -180, 1e-9) << width;
    EXPECT_NEAR(source->info().bounds.east, 180, 1e-9) << width;
  }
}

// More raster grids than the limit for querying whole windows, far apart and across the antimeridian, each of one
// height. A shallow tile must have their heights at its nodes.
TEST(ManyGrids, ManySmallGridsLieWhereTheyDo) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int k = 0; k < 24; ++k) {
    RasterSpec spec;
    spec.width = 30 + k;
    spec.height = 20;
    const double step = 0.1 + k * 0.003;  // all on different grids
    spec.geo_transform = {-181.7 + k * 15.01, step, 0, 60.0 - k * 4.9, 0, -step};
    spec.value = [k](int, int) { return 100.0 + k; };
    files.push_back({WriteRaster(dir, spec, "s" + std::to_string(k) + ".tif")});
  }
  DemOptions options;
  options.floor = -5;
  const auto source = OpenOrFail(files, options);
  ASSERT_NE(source, nullptr);
  int found = 0;
  for (int level = 0; level <= 3; ++level) {
    for (const geo::TileRange& range : source->Available(level)) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
        for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
          const geo::TileKey key{level, x, y};
          const auto tile = source->Read(key);
          ASSERT_TRUE(tile);
          std::vector<GeoPosition> nodes;
          for (int j = 0; j <= tile->lattice.cells; ++j) {
            for (int i = 0; i <= tile->lattice.cells; ++i) {
              nodes.push_back({tile->lattice.Longitude(tile->lattice.FirstColumn(key) + i),
                               tile->lattice.Latitude(tile->lattice.FirstRow(key) + j)});
            }
          }
          const auto heights = source->ReadPoints(nodes, HeightDatum::kEllipsoid);
          ASSERT_TRUE(heights);
          for (std::size_t n = 0; n < nodes.size(); ++n) {
            const int row = static_cast<int>(n) / (tile->lattice.cells + 1);
            const int column = static_cast<int>(n) % (tile->lattice.cells + 1);
            const float expected = std::isnan((*heights)[n]) ? -5 : (*heights)[n];
            ASSERT_EQ(tile->At(column, row), expected) << geo::ToString(key) << ' ' << column << ' ' << row;
            found += expected > 0 ? 1 : 0;
          }
        }
      }
    }
  }
  EXPECT_GT(found, 500);
}

// A raster of half the Earth over one of the whole Earth whose columns start below the first or at its edge. A shallow
// tile needs the second raster at both ends, and not between.
TEST(ManyGrids, WhatIsWantedOfTheEarthMayLieAtBothEndsOfATile) {
  for (const double west : {-180.0, -90.0, -60.0, 20.0}) {
    const TempDir dir;
    RasterSpec half, earth;
    half.width = 95, half.height = 90;
    half.geo_transform = {west, 180.0 / 95, 0, 90, 0, -2};
    half.value = [](int column, int row) { return 5000 + column + row; };
    earth.width = 360, earth.height = 180;
    earth.geo_transform = {-180, 1, 0, 90, 0, -1};
    earth.value = [](int column, int row) { return -column - 0.5 * row; };
    const std::string over = WriteRaster(dir, half, "half.tif"), under = WriteRaster(dir, earth, "earth.tif");
    const auto both = OpenOrFail(std::vector<DemFile>{{over}, {under}}), alone = OpenOrFail(under);
    ASSERT_TRUE(both && alone);
    for (const geo::TileKey& key : {geo::TileKey{0, 0, 0}, geo::TileKey{0, 1, 0}, geo::TileKey{1, 1, 0}}) {
      const auto tile = both->Read(key), below = alone->Read(key);
      ASSERT_TRUE(tile && below);
      int of_earth = 0;
      for (std::size_t n = 0; n < tile->heights.size(); ++n) {
        if (tile->heights[n] >= 5000) continue;
        ++of_earth;
        ASSERT_EQ(tile->heights[n], below->heights[n]) << west << ' ' << geo::ToString(key) << ' ' << n;
      }
      EXPECT_TRUE(of_earth > 0 || west == -180 || west == 20) << west;
      EXPECT_TRUE(std::isfinite(tile->source_error_m));
    }
    const auto pixels = both->ReadMercator(0, {0, 0, 256, 256}), below = alone->ReadMercator(0, {0, 0, 256, 256});
    ASSERT_TRUE(pixels && below);
    int of_earth = 0;
    for (std::size_t n = 0; n < pixels->size(); ++n) {
      if ((*pixels)[n] >= 5000) continue;
      ++of_earth;
      ASSERT_EQ((*pixels)[n], (*below)[n]) << west << ' ' << n;
    }
    EXPECT_GT(of_earth, 1000);
  }
}

}  // namespace
}  // namespace terrace::dem
