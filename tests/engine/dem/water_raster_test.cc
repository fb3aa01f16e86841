#include "engine/image/water_raster.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr int kMaskSide = WaterRaster::kSide;

std::unique_ptr<WaterRaster> OpenMask(const std::string& path, const GeoBounds& around = {}) {
  auto mask = WaterRaster::Open(path, around);
  EXPECT_TRUE(mask.has_value()) << (mask ? "" : mask.error().message);
  return mask ? *std::move(mask) : nullptr;
}

std::vector<std::uint8_t> ReadOrFail(const WaterRaster& mask, const geo::TileKey& key) {
  const auto pixels = mask.Read(key);
  EXPECT_TRUE(pixels.has_value()) << (pixels ? "" : pixels.error().message);
  return pixels.value_or(std::vector<std::uint8_t>(std::size_t{kMaskSide} * kMaskSide, 99));
}

int At(const std::vector<std::uint8_t>& pixels, int row, int column) {
  return pixels.at(static_cast<std::size_t>(row * kMaskSide + column));
}

// Exactly tile 6/65/32 (2.8125 degrees wide), 256 samples a side times `finer`.
RasterSpec WaterSpec(int finer = 1) {
  constexpr double kTile = 180.0 / 64;
  RasterSpec spec;
  spec.width = spec.height = kMaskSide * finer;
  spec.type = "Byte";
  spec.geo_transform = {kTile, kTile / kMaskSide / finer, 0, kTile, 0, -kTile / kMaskSide / finer};
  return spec;
}
constexpr geo::TileKey kWaterTile{6, 65, 32};

TEST(WaterRaster, PixelsAreTheSamplesWhereBothAgree) {
  const TempDir dir;
  RasterSpec spec = WaterSpec();
  const auto value = [](int column, int row) { return column < 100 && row >= 30 ? 7 : 0; };
  spec.value = [&](int column, int row) { return value(column, row); };
  const auto mask = OpenMask(WriteRaster(dir, spec));
  const auto pixels = ReadOrFail(*mask, kWaterTile);
  for (int row = 0; row < kMaskSide; ++row) {
    for (int column = 0; column < kMaskSide; ++column) {
      ASSERT_EQ(At(pixels, row, column), value(column, row) != 0 ? 255 : 0) << row << " " << column;
    }
  }
}

TEST(WaterRaster, AveragesFinerSamples) {
  const TempDir dir;
  RasterSpec spec = WaterSpec(4);
  spec.value = [](int column, int) { return column < 402 ? 1 : 0; };  // half of pixel 100
  const auto pixels = ReadOrFail(*OpenMask(WriteRaster(dir, spec)), kWaterTile);
  EXPECT_EQ(At(pixels, 9, 99), 255);
  EXPECT_EQ(At(pixels, 9, 100), 128);
  EXPECT_EQ(At(pixels, 9, 101), 0);
}

TEST(WaterRaster, CoarserSamplesStillGiveASharpCoast) {
  const TempDir dir;
  RasterSpec spec = WaterSpec();
  spec.value = [](int column, int) { return column < 100 ? 1 : 0; };
  // Three levels deeper a sample is 8 pixels wide: the coast is the line between samples 99 and 100.
  const auto pixels = ReadOrFail(*OpenMask(WriteRaster(dir, spec)), {9, 65 * 8 + 3, 32 * 8});
  const int coast = 800 - 3 * kMaskSide;
  EXPECT_EQ(At(pixels, 9, coast - 2), 255);
  EXPECT_GT(At(pixels, 9, coast - 1), 127);
  EXPECT_LT(At(pixels, 9, coast), 128);
  EXPECT_EQ(At(pixels, 9, coast + 1), 0);
}

TEST(WaterRaster, NoDataAndTheOutsideAreLand) {
  const TempDir dir;
  RasterSpec spec = WaterSpec();
  spec.nodata = 9;
  spec.value = [](int column, int) { return column < 128 ? 9 : 1; };
  const auto mask = OpenMask(WriteRaster(dir, spec));
  const auto pixels = ReadOrFail(*mask, kWaterTile);
  EXPECT_EQ(At(pixels, 128, 100), 0);
  EXPECT_EQ(At(pixels, 128, 200), 255);
  const auto parent = ReadOrFail(*mask, {5, 32, 16});  // the mask is its south-eastern quarter
  EXPECT_EQ(At(parent, 200, 250), 255);
  EXPECT_EQ(At(parent, 200, 130), 0);
  EXPECT_EQ(At(parent, 64, 250), 0);
  const auto far = ReadOrFail(*mask, {6, 3, 3});
  EXPECT_EQ(std::count(far.begin(), far.end(), 0), kMaskSide * kMaskSide);
}

// A pixel does not depend on the window that was read for its tile.
TEST(WaterRaster, TilesOfALevelFitTogether) {
  const TempDir dir;
  RasterSpec spec = WaterSpec(2);
  spec.value = [](int column, int row) { return (column / 8 + row / 8) % 2; };
  const auto mask = OpenMask(WriteRaster(dir, spec));
  const auto west = ReadOrFail(*mask, {7, 130, 64}), east = ReadOrFail(*mask, {7, 131, 64});
  // The pattern repeats every 16 samples, here 16 pixels, and a tile holds 256 of them.
  for (int row = 16; row < 240; ++row) {
    for (int column = 16; column < 240; ++column) {
      ASSERT_EQ(At(west, row, column), At(east, row, column)) << row << " " << column;
    }
  }
  for (int row = 16; row < 240; ++row) ASSERT_EQ(At(west, row, 255), At(west, row, 239)) << "at the common edge";
}

TEST(WaterRaster, ReadsOverviewsAndOtherReferenceSystems) {
  const TempDir dir;
  RasterSpec spec;
  spec.width = spec.height = 1024;
  spec.type = "Byte";
  spec.crs = "EPSG:32633";  // central meridian 15 degrees east
  spec.geo_transform = {500000 - 512 * 100, 100, 0, 5000000 + 512 * 100, 0, -100};
  spec.overviews = {2, 4, 8};
  spec.value = [](int column, int) { return column >= 512 ? 1 : 0; };  // water east of the meridian
  const auto mask = OpenMask(WriteRaster(dir, spec));
  // Tile 8/277/192: 14.7656 to 15.4688 degrees east, 45 to 45.7 north; the meridian is at pixel 85.3.
  const auto pixels = ReadOrFail(*mask, {8, 277, 192});
  for (const int row : {150, 200, 250}) {
    EXPECT_EQ(At(pixels, row, 83), 0) << row;
    EXPECT_EQ(At(pixels, row, 88), 255) << row;
  }
  // Tile 5/34/24: 11.25 to 16.875; the meridian is at pixel 170.7. Read from an overview.
  EXPECT_EQ(At(ReadOrFail(*mask, {5, 34, 24}), 250, 175), 255);
}

TEST(WaterRaster, OverviewsOfOddSidesShowTheCoastWhereItIs) {
  const TempDir dir;
  RasterSpec spec = WaterSpec(8);
  spec.width = spec.height = 1601;
  spec.overviews = {2, 4, 8};
  // At the start of a sample of the coarsest overview, so that no sample is mixed.
  spec.value = [](int column, int row) { return column >= 1498 || row >= 1498 ? 1 : 0; };
  const auto pixels = ReadOrFail(*OpenMask(WriteRaster(dir, spec)), kWaterTile);
  constexpr int kCoast = 187;  // three quarters of this pixel are water
  EXPECT_NEAR(At(pixels, 100, kCoast), 191, 40);
  EXPECT_NEAR(At(pixels, kCoast, 100), 191, 40);
  EXPECT_LT(At(pixels, 100, kCoast - 1), 64);
}

TEST(WaterRaster, GoesOnAcrossTheAntimeridian) {
  const TempDir dir;
  RasterSpec spec;
  spec.width = 360;
  spec.height = 180;
  spec.type = "Byte";
  spec.geo_transform = {-180, 1, 0, 90, 0, -1};
  spec.value = [](int column, int) { return column < 1 || column >= 359 ? 1 : 0; };  // a degree on both sides
  const auto mask = OpenMask(WriteRaster(dir, spec));
  const auto west = ReadOrFail(*mask, {7, 255, 64}), east = ReadOrFail(*mask, {7, 0, 64});
  EXPECT_EQ(At(west, 128, 255), 255);
  EXPECT_EQ(At(east, 128, 0), 255);
  for (int column = 0; column < kMaskSide; ++column) {
    EXPECT_NEAR(At(west, 128, 255 - column), At(east, 128, column), 1) << column;
  }
}

TEST(WaterRaster, ARasterOfAnotherPlaceIsRefused) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, WaterSpec());
  const auto refused = WaterRaster::Open(path, {-80, 20, -70, 30});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find(path), std::string::npos) << refused.error().message;
  EXPECT_NE(refused.error().message.find("nothing of the dataset"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(WaterRaster::Open(path, {170, -10, 5, 5}).has_value()) << "a box across the antimeridian, up to 5 east";
}

TEST(WaterRaster, ARasterWithoutGeoreferenceIsRefused) {
  const TempDir dir;
  RasterSpec spec = WaterSpec();
  spec.georeferenced = false;
  const auto refused = WaterRaster::Open(WriteRaster(dir, spec), {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message.find("no georeference"), std::string::npos) << refused.error().message;
}

TEST(WaterRaster, SaysWhenItsFileChanged) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, WaterSpec());
  const auto mask = OpenMask(path);
  const std::uint64_t before = mask->fingerprint();
  std::filesystem::resize_file(path, 100);
  EXPECT_EQ(mask->Read(kWaterTile).error().code, ErrorCode::kChanged);
  WriteRaster(dir, WaterSpec(2));
  EXPECT_NE(OpenMask(path)->fingerprint(), before);
}

TEST(WaterRaster, StopsWhenAsked) {
  const TempDir dir;
  RasterSpec spec = WaterSpec();
  spec.value = [](int column, int row) { return (column * row) % 3; };
  const auto mask = OpenMask(WriteRaster(dir, spec));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(mask->Read(kWaterTile, stop.get_token()).error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace terrace::dem
