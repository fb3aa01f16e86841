// A global node has the same bits in every tile.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

std::uint32_t Bits(float value) { return std::bit_cast<std::uint32_t>(value); }

// Compares the three rows or columns that a tile shares with its eastern and its northern neighbour.
void ExpectSameBorders(const ElevationModel& model, const geo::TileKey& key) {
  const auto tile = model.Read(key);
  ASSERT_TRUE(tile) << tile.error().message;
  const int n = tile->lattice.cells;
  const auto east = model.Read(geo::Neighbour(key, 1, 0));
  ASSERT_TRUE(east) << east.error().message;
  int different = 0;
  for (int j = -1; j <= n + 1; ++j) {
    for (int i = -1; i <= 1; ++i) different += Bits(tile->At(n + i, j)) != Bits(east->At(i, j));
  }
  EXPECT_EQ(different, 0) << "east of " << geo::ToString(key);
  const geo::TileKey above = geo::Neighbour(key, 0, 1);
  if (!geo::IsValid(above)) return;
  const auto north = model.Read(above);
  ASSERT_TRUE(north) << north.error().message;
  different = 0;
  for (int i = -1; i <= n + 1; ++i) {
    for (int j = -1; j <= 1; ++j) different += Bits(tile->At(i, n + j)) != Bits(north->At(i, j));
  }
  EXPECT_EQ(different, 0) << "north of " << geo::ToString(key);
}

TEST(Borders, AreBitEqualForEveryKindOfCrs) {
  for (const std::string& name : RealRasters()) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, level < 4 ? 2 : 3)) ExpectSameBorders(*source, key);
    }
  }
}

TEST(Borders, AreBitEqualAcrossTheAntimeridian) {
  for (const std::string name : {"antimeridian_hawaii_topobathy_5min.tif", "etopo5_global_10min.tif",
                                 "etopo1_global_1deg_float32.tif", "pole_antarctica_bedmap_5km.tif"}) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const std::int64_t eighth : {0, 1, 4, 5}) {
        ExpectSameBorders(*source, {level, geo::TileColumns(level) - 1, geo::TileRows(level) * eighth / 8});
      }
    }
  }
}

// The last block of averages has fewer samples than the others, and a hole lies on both sides of the antimeridian.
TEST(Borders, AreBitEqualWhereAHoleCrossesTheAntimeridian) {
  const TempDir dir;
  for (const int columns : {1001, 1002}) {
    SCOPED_TRACE(columns);
    const double pixel = 360.0 / columns;
    RasterSpec spec{.width = columns, .height = 500, .geo_transform = {-180, pixel, 0, 90, 0, -pixel}};
    spec.nodata = -9999;
    spec.value = [columns](int column, int row) {
      if (row >= 100 && row < 400 && (column < 150 || column >= columns - 150)) return -9999.0;
      const double turn = 2 * 3.14159265358979 * column / columns;
      return 2000 + 1500 * std::sin(3 * turn + 1) + 1000 * std::sin(row / 40.0) + 300 * std::sin(40 * turn);
    };
    const auto source = OpenOrFail(WriteRaster(dir, spec, std::to_string(columns) + ".tif"));
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (std::int64_t row = 0; row < geo::TileRows(level);
           row += std::max<std::int64_t>(1, geo::TileRows(level) / 8)) {
        ExpectSameBorders(*source, {level, geo::TileColumns(level) - 1, row});
      }
    }
  }
}

// The pole is the corner of a polar raster up to rounding.
TEST(Borders, AreBitEqualWhereARasterEndsAtThePole) {
  const TempDir dir;
  const std::string base = WriteRaster(dir, FlatSquare(-180, 90, 180, 1, 0), "base.tif");
  const std::string east = WriteRaster(dir, FlatSquare(0, 90, 180, 1, 0), "east.tif");
  constexpr double kPixel = 19999.1, kSide = kPixel * 60;
  RasterSpec spec{.width = 60, .height = 60, .geo_transform = {-kSide, kPixel, 0, kSide, 0, -kPixel}};
  spec.crs = "EPSG:3031";
  spec.value = [](int, int) { return 3000.0; };
  const auto source = OpenOrFail({{WriteRaster(dir, spec, "polar.tif"), 0}, {base, 1}, {east, 1}});
  ASSERT_NE(source, nullptr);
  for (int level = 2; level <= 5; ++level) {
    for (std::int64_t column = 0; column < geo::TileColumns(level); ++column) {
      ExpectSameBorders(*source, {level, column, 0});
    }
  }
}

// A source around the whole Earth with one void, close to the antimeridian on one side. The blend around the void
// reaches across it. With one raster, and with two that form one raster grid.
TEST(Borders, AreBitEqualWhereABlendCrossesTheAntimeridian) {
  const TempDir dir;
  const std::string base = WriteRaster(dir, FlatSquare(-180, 90, 180, 1, 300), "base.tif");
  const std::string east = WriteRaster(dir, FlatSquare(0, 90, 180, 1, 300), "east.tif");
  for (const int void_column : {350, 5}) {
    const auto part = [&](int first, int width, const std::string& name) {
      RasterSpec spec{.width = width, .height = 180, .geo_transform = {first - 180.0, 1, 0, 90, 0, -1}};
      spec.nodata = -1;
      spec.value = [first, void_column](int c, int r) {
        return std::abs(first + c - void_column) <= 2 && r >= 80 && r < 100 ? -1.0 : 100.0;
      };
      return WriteRaster(dir, spec, std::to_string(void_column) + name);
    };
    const std::string whole = part(0, 360, "whole.tif");
    const std::string west_half = part(0, 180, "west.tif"), east_half = part(180, 180, "east.tif");
    DemOptions options{.feather = 1'000'000};
    options.max_void_gap = 0;
    for (const std::vector<DemFile>& upper : {std::vector<DemFile>{{whole, 0}}, {{west_half, 0}, {east_half, 0}}}) {
      SCOPED_TRACE(std::to_string(void_column) + ", rasters: " + std::to_string(upper.size()));
      std::vector<DemFile> files = upper;
      files.push_back({base, 1});
      files.push_back({east, 1});
      const auto source = OpenOrFail(files, options);
      ASSERT_NE(source, nullptr);
      bool is_blended = false;
      for (int level = 0; level <= source->max_level(); ++level) {
        for (std::int64_t row = 0; row < geo::TileRows(level);
             row += std::max<std::int64_t>(1, geo::TileRows(level) / 8)) {
          const geo::TileKey key{level, geo::TileColumns(level) - 1, row};
          ExpectSameBorders(*source, key);
          const auto tile = source->Read(key);
          ASSERT_TRUE(tile);
          const float height = tile->At(tile->lattice.cells, tile->lattice.cells / 2);
          is_blended |= height > 101 && height < 299;
        }
      }
      EXPECT_TRUE(is_blended);
    }
  }
}

TEST(Borders, AreBitEqualInRotatedAndInternationalDatums) {
  const TempDir dir;
  RasterSpec spec{.width = 200, .height = 150, .geo_transform = {7, .002, .0004, 47, .0003, -.0015}};
  spec.value = [](int col, int row) { return col * 1.25 + row * row * 0.03; };
  RasterSpec old_datum = spec;
  old_datum.crs = "EPSG:4230";
  old_datum.geo_transform = {7, .002, 0, 47, 0, -.0015};
  RasterSpec antimeridian = old_datum;
  antimeridian.crs = "EPSG:4322";
  antimeridian.geo_transform = {179.8, .002, 0, 47, 0, -.0015};
  int index = 0;
  for (const RasterSpec& each : {spec, old_datum, antimeridian}) {
    SCOPED_TRACE(index);
    const auto source = OpenOrFail(WriteRaster(dir, each, std::to_string(index++) + ".tif"));
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 3)) ExpectSameBorders(*source, key);
    }
  }
}

TEST(Borders, PoleRowsAreOneValue) {
  for (const std::string name :
       {"etopo5_global_10min.tif", "etopo1_global_1deg_float32.tif", "pole_antarctica_bedmap_5km.tif"}) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      const auto first = source->Read({level, 0, 0});
      const auto other = source->Read({level, geo::TileColumns(level) / 2 + 1 - (level == 0), 0});
      ASSERT_TRUE(first && other);
      EXPECT_NE(first->At(0, 0), source->info().floor) << level;
      for (int i = -1; i <= first->lattice.cells + 1; ++i) {
        ASSERT_EQ(Bits(first->At(i, 0)), Bits(first->At(0, 0)));
        ASSERT_EQ(Bits(other->At(i, 0)), Bits(first->At(0, 0)));
      }
    }
  }
}

}  // namespace
}  // namespace terrace::dem
