#include "engine/raster/raster_layout.h"

#include <gdal_priv.h>

#include <cmath>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(GridAxis, LocatesPositionsBetweenCentres) {
  const GridAxis axis(10, 1, false);
  EXPECT_EQ(axis.Locate(2.5).index, 2);
  EXPECT_EQ(axis.Locate(2.5).weight, 0);
  EXPECT_EQ(axis.Locate(3.25).index, 2);
  EXPECT_EQ(axis.Locate(3.25).weight, .75);
  EXPECT_EQ(axis.Locate(0.1).index, 0);
  EXPECT_EQ(axis.Locate(0.1).weight, 0);
  EXPECT_EQ(axis.Locate(10).index, 9);
  EXPECT_EQ(axis.Locate(10).weight, 0);
}

TEST(GridAxis, KnowsThatTheLastBlockMayBeSmaller) {
  const GridAxis axis(10, 4, false);  // blocks 0..3, 4..7, 8..9: centres 2, 6, 9
  EXPECT_EQ(axis.count(), 3);
  EXPECT_EQ(axis.Center(2), 9);
  EXPECT_EQ(axis.Locate(7.5).index, 1);
  EXPECT_EQ(axis.Locate(7.5).weight, .5);
  EXPECT_EQ(axis.Locate(9.5).index, 2);
}

TEST(GridAxis, WrapsAround) {
  const GridAxis axis(10, 4, true);  // then the first block again, centre 12
  EXPECT_EQ(axis.Locate(9.5).index, 2);
  EXPECT_NEAR(axis.Locate(9.5).weight, .5 / 3, 1e-15);
  EXPECT_EQ(axis.Locate(.5).index, -1);
  EXPECT_NEAR(axis.Locate(.5).weight, 1.5 / 3, 1e-15);
}

struct OpenGrid {
  GDALDatasetUniquePtr dataset;
  RasterLayout layout;
};

OpenGrid OpenAs(const std::string& path, bool wraps) {
  OpenGrid grid;
  grid.dataset.reset(GDALDataset::Open(path.c_str()));
  grid.layout.width = grid.layout.columns = grid.dataset->GetRasterXSize();
  grid.layout.height = grid.dataset->GetRasterYSize();
  grid.layout.wraps = wraps;
  grid.layout.rules = SampleRules::Of(*grid.dataset->GetRasterBand(1), "");
  return grid;
}

TEST(ReadAverages, AveragesTheValidSamplesOfAlignedBlocks) {
  const TempDir dir;
  RasterSpec spec{.width = 10, .height = 9, .nodata = -1};
  spec.value = [](int col, int row) {
    return col < 4 && row < 4 ? (row == 2 ? 6.0 : -1.0) : col < 8 && row < 4 ? -1.0 : col;
  };
  const OpenGrid grid = OpenAs(WriteRaster(dir, spec), false);
  const auto heights = ReadAverages(*grid.dataset, grid.layout, 4, {0, 0, 3, 3}, {});
  ASSERT_TRUE(heights) << heights.error().message;
  EXPECT_EQ((*heights)[0], 6);
  EXPECT_TRUE(std::isnan((*heights)[1]));
  EXPECT_EQ((*heights)[2], 8.5f);
  EXPECT_EQ((*heights)[4], 5.5f);
  EXPECT_EQ((*heights)[8], 8.5f);
}

TEST(ReadAverages, WindowsAndWrappingChangeNoValue) {
  const TempDir dir;
  RasterSpec spec{.width = 50, .height = 40};
  spec.value = [](int col, int row) { return std::sin(col * 1.7) * 100 + std::cos(row * 2.3 + col); };
  const OpenGrid grid = OpenAs(WriteRaster(dir, spec), true);
  for (const int factor : {1, 2, 4, 8}) {
    const std::int64_t columns = (50 + factor - 1) / factor, rows = 40 / factor;
    const auto whole = ReadAverages(*grid.dataset, grid.layout, factor, {0, 0, columns, rows}, {});
    const GridWindow window{columns - 2, 1, columns + 3, 3};
    const auto part = ReadAverages(*grid.dataset, grid.layout, factor, window, {});
    ASSERT_TRUE(whole && part);
    for (std::int64_t r = 0; r < window.rows; ++r) {
      for (std::int64_t c = 0; c < window.columns; ++c) {
        EXPECT_EQ((*part)[static_cast<std::size_t>(r * window.columns + c)],
                  (*whole)[static_cast<std::size_t>((r + 1) * columns + (window.column + c) % columns)]);
      }
    }
  }
}

TEST(ReadAverages, StartsFromOverviews) {
  const TempDir dir;
  RasterSpec spec{.width = 512, .height = 512, .overviews = {4}};
  spec.value = [](int col, int) { return col; };
  OpenGrid grid = OpenAs(WriteRaster(dir, spec), false);
  grid.layout.overview_factors = {4};
  const auto from_overview = ReadAverages(*grid.dataset, grid.layout, 8, {3, 5, 10, 2}, {});
  grid.layout.overview_factors = {};
  const auto from_samples = ReadAverages(*grid.dataset, grid.layout, 8, {3, 5, 10, 2}, {});
  ASSERT_TRUE(from_overview && from_samples);
  EXPECT_EQ(*from_overview, *from_samples);
  grid.layout.overview_factors = {2};
  EXPECT_EQ(ReadAverages(*grid.dataset, grid.layout, 8, {3, 5, 10, 2}, {}).error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace terrace::dem
