// A raster grid of one source: a full turn around the Earth, voids that are not read, a mask.
#include <gdal_priv.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "engine/mosaic/raster_grid.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/source_fixture.h"

namespace terrace::dem {
namespace {

// The grid closes on whole columns. The remainder of 360 degrees is between its last and its first column, and a bound
// on the error must include it.
TEST(OneSource, WhatIsLeftOfAFullTurnCountsAsMisplacement) {
  for (const double left : {0.0, -0.0095, 0.0095}) {  // columns
    const TempDir dir;
    const double pixel = 360 / (720 + left);
    const auto raster = OpenRasterOrFail(WriteRaster(dir, {.width = 720,
                                                           .height = 4,
                                                           .geo_transform = {-180, pixel, 0, 1, 0, -pixel},
                                                           .value = [](int col, int row) { return col + row; }}));
    std::vector<GridPlan> plans = PlanGrids({raster});
    ASSERT_EQ(plans.size(), 1U);
    const auto grid = RasterGrid::Make(std::move(plans.front()), {.max_void_gap = 64});
    ASSERT_TRUE(grid);
    EXPECT_TRUE(grid->wraps());
    EXPECT_GE(grid->members().front().misplacement.x, std::abs(left) * 0.999);
    EXPECT_LE(grid->members().front().misplacement.x, std::abs(left) * 3 + 1e-6);
  }
}

TEST(OneSource, TheLogTellsOfColumnsBeyondAFullTurn) {
  for (const int width : {360, 361, 540}) {  // pixels, nodes at -180 and 180 degrees, one and a half turns
    const TempDir dir;
    const std::string path = WriteRaster(
        dir, {.width = width, .height = 180, .geo_transform = {-180, 1, 0, 90, 0, -1}, .value = [](int col, int row) {
                return col + row;
              }});
    const std::string log = LogOf([&] { EXPECT_TRUE(ElevationModel::Open(path).has_value()); });
    EXPECT_EQ(log.find("its last 180 columns") != std::string::npos, width == 540) << log;
    EXPECT_EQ(log.find("more than once around the Earth") != std::string::npos, width == 540) << log;
  }
}

// A collar of voids to the east; a hole has samples around it, from which it is filled.
TEST(OneSource, VoidsThatTheStatisticsKnowAreNotRead) {
  const TempDir dir;
  RasterSpec spec;
  spec.width = 1200, spec.height = 600;
  spec.geo_transform = {10, 0.001, 0, 20, 0, -0.001};
  spec.nodata = -9999;
  spec.value = [](int column, int row) {
    const bool is_hole = column > 100 && column < 400 && row > 100 && row < 400;
    return column >= 600 || is_hole ? -9999 : 100 + column;
  };
  const std::string path = WriteRaster(dir, spec);
  std::vector<GridPlan> plans = PlanGrids({OpenRasterOrFail(path)});
  const auto grid = RasterGrid::Make(std::move(plans.front()), {.max_void_gap = 8});
  ASSERT_TRUE(grid);
  const geo::Lattice lattice{11, 64};
  const auto key_at = [&](double longitude, double latitude) {
    const double tile = 180.0 / (1 << lattice.level);
    return geo::TileKey{lattice.level, static_cast<std::int64_t>((longitude + 180) / tile),
                        static_cast<std::int64_t>((latitude + 90) / tile)};
  };
  const auto read = [&](const geo::TileKey& key, std::vector<float>& hole_heights) {
    const NodeWindow window = WindowOfTile(lattice, key);
    std::vector<float> heights(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                               SampleRules::kVoid);
    GridReading reading;
    auto filled = grid->FillNodes(lattice, window, HeightDatum::kEllipsoid,
                                  {.heights = heights, .hole_heights = &hole_heights, .are_void = true}, {}, &reading);
    EXPECT_TRUE(std::ranges::all_of(heights, [](float height) { return std::isnan(height); }));
    return filled ? Result<GridReading>(std::move(reading)) : tl::unexpected(filled.error());
  };
  std::vector<float> hole_heights;
  const auto collar = read(key_at(11, 19.7), hole_heights);
  ASSERT_TRUE(collar) << collar.error().message;
  EXPECT_TRUE(collar->samples.empty());
  EXPECT_TRUE(hole_heights.empty());
  const auto hole = read(key_at(10.25, 19.75), hole_heights);
  ASSERT_TRUE(hole) << hole.error().message;
  EXPECT_FALSE(hole->samples.empty());
  EXPECT_FALSE(hole_heights.empty());
  // What was not read may not outlive its file either.
  std::filesystem::remove(path);
  EXPECT_FALSE(read(key_at(11, 19.7), hole_heights));
}

// A mask of one band, as GDAL also stores it in separate files and in VRTs.
TEST(OneSource, AMaskOfTheBandAloneCounts) {
  const TempDir dir;
  RasterSpec spec;
  spec.value = [](int col, int) { return col < 8 ? 500 : 8000; };
  const std::string path = WriteRaster(dir, spec);
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    GDALRasterBand& band = *dataset->GetRasterBand(1);
    EXPECT_EQ(band.CreateMaskBand(0), CE_None);
    const std::vector<std::uint8_t> line = {1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0};
    for (int row = 0; row < spec.height; ++row) {
      EXPECT_EQ(band.GetMaskBand()->RasterIO(GF_Write, 0, row, spec.width, 1, const_cast<std::uint8_t*>(line.data()),
                                             spec.width, 1, GDT_Byte, 0, 0, nullptr),
                CE_None);
    }
  }
  const auto source = OpenOrFail(path, {.source = {.vertical = "unknown"}});
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->info().sources.front().heights.max, 500);
  EXPECT_EQ(source->info().sources.front().void_samples, 128U);
}

}  // namespace
}  // namespace terrace::dem
