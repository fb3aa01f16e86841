// Mosaics of rasters far apart or all around the Earth: their bounds, and what shallow tiles take of many.
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

// Where pieces meet their corners differ by rounding.
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

// More raster grids than are asked about whole windows, far apart and across the antimeridian, each of one height: what
// a shallow tile has of them is what they have at its nodes.
TEST(ManyGrids, ManySmallGridsLieWhereTheyDo) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int k = 0; k < 24; ++k) {
    RasterSpec spec;
    spec.width = 30 + k;
    spec.height = 20;
    const double step = 0.1 + k * 0.003;  // no two on one grid
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

}  // namespace
}  // namespace terrace::dem
