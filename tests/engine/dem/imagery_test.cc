#include "engine/image/imagery.h"

#include <fmt/format.h>
#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>

#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/source_fixture.h"

namespace terrace::dem {
namespace {

using Color = std::array<int, 3>;
constexpr Color kNone = {Imagery::kNoPicture[0], Imagery::kNoPicture[1], Imagery::kNoPicture[2]};

struct ImageSpec {
  int width = 256, height = 256;
  std::array<double, 6> geo_transform = {};
  std::string crs = "EPSG:4326";
  std::vector<int> overviews = {};
  int nodata = -1;  // none
  std::function<Color(int, int)> color = [](int, int) { return Color{1, 2, 3}; };
};

// Tile 6/65/32, 2.8125 degrees wide, in 256 pixels times `finer`.
ImageSpec TileSpec(int finer = 1) {
  constexpr double kWidth = 180.0 / 64;
  ImageSpec spec;
  spec.width = spec.height = 256 * finer;
  spec.geo_transform = {kWidth, kWidth / spec.width, 0, kWidth, 0, -kWidth / spec.width};
  return spec;
}
constexpr geo::TileKey kTile{6, 65, 32};

std::string WriteImage(const TempDir& dir, const ImageSpec& spec) {
  GDALAllRegister();
  const std::string path = dir.File("image.tif");
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  GDALDatasetUniquePtr dataset(driver->Create(path.c_str(), spec.width, spec.height, 3, GDT_Byte, nullptr));
  std::array<double, 6> transform = spec.geo_transform;
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference srs;
  EXPECT_EQ(srs.SetFromUserInput(spec.crs.c_str()), OGRERR_NONE);
  srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  dataset->SetSpatialRef(&srs);
  std::vector<std::uint8_t> line(static_cast<std::size_t>(spec.width));
  for (int band = 0; band < 3; ++band) {
    if (spec.nodata >= 0) dataset->GetRasterBand(band + 1)->SetNoDataValue(spec.nodata);
    for (int row = 0; row < spec.height; ++row) {
      for (int column = 0; column < spec.width; ++column) {
        line[static_cast<std::size_t>(column)] =
            static_cast<std::uint8_t>(spec.color(column, row)[static_cast<std::size_t>(band)]);
      }
      EXPECT_EQ(dataset->GetRasterBand(band + 1)->RasterIO(GF_Write, 0, row, spec.width, 1, line.data(), spec.width, 1,
                                                           GDT_Byte, 0, 0, nullptr),
                CE_None);
    }
  }
  if (!spec.overviews.empty()) {
    std::vector<int> factors = spec.overviews;
    dataset->FlushCache(false);
    EXPECT_EQ(dataset->BuildOverviews("AVERAGE", static_cast<int>(factors.size()), factors.data(), 0, nullptr,
                                      GDALDummyProgress, nullptr),
              CE_None);
  }
  return path;
}

std::unique_ptr<Imagery> OpenImage(const std::string& path, const GeoBounds& around = {}) {
  auto imagery = Imagery::Open(path, around);
  EXPECT_TRUE(imagery.has_value()) << (imagery ? "" : imagery.error().message);
  return imagery ? *std::move(imagery) : nullptr;
}

std::optional<TilePicture> ReadOrFail(const Imagery& imagery, const geo::TileKey& key, int side) {
  auto picture = imagery.Read(key, side);
  EXPECT_TRUE(picture.has_value()) << (picture ? "" : picture.error().message);
  return picture ? *std::move(picture) : std::nullopt;
}

Color At(const TilePicture& picture, int row, int column) {
  const std::uint8_t* const p = picture.rgb.data() + 3 * (row * picture.side + column);
  return {p[0], p[1], p[2]};
}

TEST(Imagery, PixelsAreTheImagesWhereBothAgree) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.color = [](int column, int row) { return Color{column, row, (column + row) % 256}; };
  const auto picture = ReadOrFail(*OpenImage(WriteImage(dir, spec)), kTile, 256);
  ASSERT_TRUE(picture.has_value());
  EXPECT_EQ(picture->side, 256);
  for (int row = 0; row < 256; ++row) {
    for (int column = 0; column < 256; ++column) {
      ASSERT_EQ(At(*picture, row, column), spec.color(column, row)) << row << " " << column;
    }
  }
}

TEST(Imagery, AveragesFinerPixelsWithAndWithoutOverviews) {
  for (const bool has_overviews : {false, true}) {
    const TempDir dir;
    ImageSpec spec = TileSpec(4);
    if (has_overviews) spec.overviews = {2, 4, 8};
    spec.color = [](int column, int row) { return Color{column % 4 * 10, row % 2 * 50, 7}; };
    const auto picture = ReadOrFail(*OpenImage(WriteImage(dir, spec)), kTile, 256);
    ASSERT_TRUE(picture.has_value());
    for (const int at : {0, 77, 255}) EXPECT_EQ(At(*picture, at, at), (Color{15, 25, 7})) << has_overviews;
  }
}

TEST(Imagery, OverviewsOfOddSidesShowThePixelsWhereTheyAre) {
  const TempDir dir;
  ImageSpec spec = TileSpec(8);
  spec.width = spec.height = 2041;  // the image ends within the tile
  spec.overviews = {2, 4, 8};
  const auto level = [](int pixel) { return std::clamp(pixel - 1800, 0, 240); };
  spec.color = [&](int column, int row) { return Color{level(column), level(row), 7}; };
  const auto picture = ReadOrFail(*OpenImage(WriteImage(dir, spec)), kTile, 256);
  ASSERT_TRUE(picture.has_value());
  for (const int at : {230, 240, 250}) {
    const double centre = 8 * at + 3.5 - 1800;
    EXPECT_NEAR(At(*picture, 100, at)[0], centre, 1) << at;
    EXPECT_NEAR(At(*picture, at, 100)[1], centre, 1) << at;
  }
}

TEST(Imagery, OverviewsMayBeOnePixelHigh) {
  const TempDir dir;
  ImageSpec spec = TileSpec(4);
  spec.width = 300;
  spec.height = 200;
  spec.overviews = {2, 4, 8, 16, 32, 64, 128, 256};  // the last has 2 x 1 pixels
  const auto imagery = OpenImage(WriteImage(dir, spec));
  for (int level = kTile.level; level >= 0; --level) {
    const int shift = kTile.level - level;
    const auto picture = ReadOrFail(*imagery, {level, kTile.x >> shift, kTile.y >> shift}, 256);
    ASSERT_TRUE(picture.has_value()) << level;
    int shown = 0;
    for (int i = 0; i < 256 * 256; ++i) {
      const Color color = At(*picture, 0, i);
      ASSERT_TRUE(color == kNone || color == spec.color(0, 0)) << level;
      shown += color == kNone ? 0 : 1;
    }
    EXPECT_GT(shown, 0) << level;
  }
}

TEST(Imagery, InterpolatesCoarserPixelsAcrossTiles) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.color = [](int column, int) { return Color{column, 0, 255 - column}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  const auto west = ReadOrFail(*imagery, {9, 65 * 8 + 3, 32 * 8 + 4}, 256);
  const auto east = ReadOrFail(*imagery, {9, 65 * 8 + 4, 32 * 8 + 4}, 256);
  ASSERT_TRUE(west.has_value() && east.has_value());
  // 8 pixels for one of the image: the ramp continues across the edge.
  EXPECT_LE(At(*west, 9, 255)[0], At(*east, 9, 0)[0]);
  EXPECT_LE(At(*east, 9, 0)[0] - At(*west, 9, 255)[0], 1);
  for (int column = 1; column < 256; ++column) {
    const int step = At(*west, 9, column)[0] - At(*west, 9, column - 1)[0];
    EXPECT_TRUE(step == 0 || step == 1) << column;
  }
}

TEST(Imagery, IsGreyWhereTheImageEndsOrHasNoData) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.nodata = 0;
  spec.color = [](int column, int) { return column < 100 ? Color{0, 0, 0} : Color{200, 100, 50}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  const auto picture = ReadOrFail(*imagery, kTile, 256);
  ASSERT_TRUE(picture.has_value());
  EXPECT_EQ(At(*picture, 128, 50), kNone);
  EXPECT_EQ(At(*picture, 128, 200), (Color{200, 100, 50}));
  const auto parent = ReadOrFail(*imagery, {5, 32, 16}, 256);  // the image is its south-eastern quarter
  ASSERT_TRUE(parent.has_value());
  EXPECT_EQ(At(*parent, 200, 250), (Color{200, 100, 50}));
  EXPECT_EQ(At(*parent, 64, 250), kNone);
  EXPECT_EQ(At(*parent, 200, 64), kNone);
}

TEST(Imagery, HasNothingForTilesThatItDoesNotShow) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.nodata = 9;
  spec.color = [](int column, int) { return column < 130 ? Color{9, 9, 9} : Color{1, 1, 1}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  EXPECT_FALSE(ReadOrFail(*imagery, {6, 3, 3}, 256).has_value());
  EXPECT_FALSE(ReadOrFail(*imagery, {7, 130, 65}, 256).has_value()) << "no data alone";
  EXPECT_TRUE(ReadOrFail(*imagery, {7, 131, 65}, 256).has_value());
}

// Overviews state the nodata value of the time when they were made.
TEST(Imagery, OverviewsThatStateAnotherNodataValueAreNotUsed) {
  constexpr int kNodata = 9, kNoValue = -1;
  for (const bool are_inside : {true, false}) {
    for (const auto& [before, after] : {std::pair{kNodata, kNodata}, {kNoValue, kNodata}, {kNodata, kNoValue}}) {
      SCOPED_TRACE(fmt::format("{} nodata {} then {}", are_inside ? "inside" : "beside", before, after));
      const TempDir dir;
      ImageSpec spec = TileSpec(4);
      spec.nodata = before;
      spec.color = [](int column, int) { return column < 512 ? Color{9, 9, 9} : Color{200, 100, 50}; };
      const std::string path = WriteImage(dir, spec);
      {
        const GDALDatasetUniquePtr dataset(
            GDALDataset::Open(path.c_str(), are_inside ? GDAL_OF_RASTER | GDAL_OF_UPDATE : GDAL_OF_RASTER));
        const std::array<int, 2> factors = {2, 4};
        ASSERT_EQ(dataset->BuildOverviews("AVERAGE", 2, factors.data(), 0, nullptr, GDALDummyProgress, nullptr),
                  CE_None);
      }
      if (before != after) {
        const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
        for (int band = 1; band <= 3; ++band) {
          if (after == kNoValue) dataset->GetRasterBand(band)->DeleteNoDataValue();
          if (after != kNoValue) dataset->GetRasterBand(band)->SetNoDataValue(after);
        }
      }
      std::unique_ptr<Imagery> imagery;
      const std::string log = LogOf([&] { imagery = OpenImage(path); });
      EXPECT_EQ(log.find("overviews are not used: they state another nodata value") != std::string::npos,
                before != after)
          << log;
      for (const geo::TileKey& key : {kTile, geo::TileKey{8, 65 * 4, 32 * 4}}) {  // an overview, and the full image
        const auto picture = ReadOrFail(*imagery, key, 256);
        const Color hidden = after == kNoValue ? Color{9, 9, 9} : kNone;
        EXPECT_EQ(picture ? At(*picture, 128, 64) : kNone, hidden) << geo::ToString(key);
      }
      EXPECT_EQ(At(*ReadOrFail(*imagery, kTile, 256), 128, 192), (Color{200, 100, 50}));
    }
  }
}

TEST(Imagery, HasFewerPixelsWhereTheImageHasNoMore) {
  const TempDir dir;
  const auto imagery = OpenImage(WriteImage(dir, TileSpec()));  // as fine as 256 pixels at level 6
  EXPECT_EQ(imagery->SideOf(6, 1024), 256);
  EXPECT_EQ(imagery->SideOf(5, 1024), 512);
  EXPECT_EQ(imagery->SideOf(4, 1024), 1024);
  EXPECT_EQ(imagery->SideOf(0, 512), 512);
  EXPECT_EQ(imagery->SideOf(12, 1024), 256);
  EXPECT_EQ(imagery->SideOf(12, 64), 64);
}

TEST(Imagery, PlacesImagesOfOtherReferenceSystems) {
  const TempDir dir;
  ImageSpec spec;
  spec.width = spec.height = 1024;
  spec.crs = "EPSG:32633";  // central meridian 15 degrees east
  spec.geo_transform = {500000 - 512 * 100, 100, 0, 5000000 + 512 * 100, 0, -100};
  spec.color = [](int column, int) { return column >= 512 ? Color{250, 0, 0} : Color{0, 250, 0}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  // Tile 8/277/192: 14.7656 to 15.4688 degrees east, 45 to 45.7 north; the meridian is at pixel 85.3.
  const auto picture = ReadOrFail(*imagery, {8, 277, 192}, 256);
  ASSERT_TRUE(picture.has_value());
  EXPECT_EQ(At(*picture, 240, 83), (Color{0, 250, 0}));
  EXPECT_EQ(At(*picture, 240, 88), (Color{250, 0, 0}));
}

TEST(Imagery, ReadsARealPhotoOfARealModel) {
  TERRACE_REQUIRE_DATA(photo, "ortho_pair_rgb_2m.tif");
  TERRACE_REQUIRE_DATA(model, "ortho_pair_dtm_2m_byte.tif");
  const auto source = OpenOrFail(model);
  const auto imagery = OpenImage(photo, source->info().bounds);
  int pictures = 0;
  for (const geo::TileKey& key : SomeTiles(*source, 14, 4)) {
    const auto picture = ReadOrFail(*imagery, key, imagery->SideOf(14, 512));
    if (!picture) continue;
    ++pictures;
    EXPECT_EQ(picture->side, 512);
    EXPECT_GT(std::count_if(picture->rgb.begin(), picture->rgb.end(), [](int level) { return level != 188; }), 3000);
  }
  EXPECT_GT(pictures, 0);
}

TEST(Imagery, MapPicturesOfTerrainTilesAreTheirTextures) {
  const TempDir dir;
  ImageSpec spec = TileSpec(2);
  spec.nodata = 0;
  spec.color = [](int column, int row) { return column < 100 ? Color{0, 0, 0} : Color{column % 256, row % 256, 7}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  for (const geo::TileKey& key : {kTile, geo::TileKey{5, 32, 16}, geo::TileKey{8, 65 * 4 + 1, 32 * 4 + 2}}) {
    const auto texture = ReadOrFail(*imagery, key, 256);
    const auto map = imagery->ReadGeodetic(key, 256);
    ASSERT_TRUE(texture && map);
    for (std::size_t i = 0; i < 65536; ++i) {
      const std::uint8_t* const rgba = map->rgba.data() + 4 * i;
      ASSERT_TRUE(rgba[3] == 0 || rgba[3] == 255);
      const Color own = rgba[3] == 0 ? kNone : Color{rgba[0], rgba[1], rgba[2]};
      ASSERT_EQ(own, At(*texture, static_cast<int>(i / 256), static_cast<int>(i % 256))) << i;
    }
  }
  EXPECT_EQ(imagery->ReadGeodetic({6, 3, 3}, 256)->rgba, std::vector<std::uint8_t>(4 * 65536)) << "transparent";
}

// The image tells its own position: a column is 2.8125 / 256 degrees.
TEST(Imagery, MercatorPixelsShowTheirPlace) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.color = [](int column, int row) { return Color{column, row, 9}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  const ImageExtent extent = imagery->extent();
  EXPECT_NEAR(extent.bounds.west, 2.8125, 1e-9);
  EXPECT_NEAR(extent.bounds.north, 2.8125, 1e-9);
  EXPECT_EQ(extent.max_geodetic_level, 6);
  EXPECT_EQ(extent.max_mercator_depth, 8) << "as for heights: its rows are a little closer than pixels of depth 7";
  const geo::MercatorGrid grid{7};
  const std::int64_t column = 65 * 256, row = 62 * 256 + 128;
  const auto picture = imagery->ReadMercator(7, column, row, 256);
  ASSERT_TRUE(picture) << picture.error().message;
  int shown = 0;
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      const std::uint8_t* const rgba = picture->rgba.data() + 4 * (256 * y + x);
      const double degrees = 2.8125 / 256;
      const double east = (grid.Longitude(column + x) - 2.8125) / degrees,
                   south = (2.8125 - grid.Latitude(row + y)) / degrees;
      const bool is_inside = east > 0 && east < 256 && south > 0 && south < 256;
      ASSERT_EQ(rgba[3], is_inside ? 255 : 0) << x << " " << y;
      if (!is_inside) continue;
      ++shown;
      ASSERT_NEAR(rgba[0], std::clamp(east - 0.5, 0.0, 255.0), 0.51);
      ASSERT_NEAR(rgba[1], std::clamp(south - 0.5, 0.0, 255.0), 0.51);
    }
  }
  EXPECT_GT(shown, 10'000);
}

TEST(Imagery, MercatorPixelsAreAveragesAndDoNotDependOnTheTile) {
  for (const bool has_overviews : {false, true}) {
    const TempDir dir;
    ImageSpec spec = TileSpec(8);
    if (has_overviews) spec.overviews = {2, 4, 8};
    spec.color = [](int column, int row) { return Color{(column + row) % 2 * 200, 40, 7}; };
    const auto imagery = OpenImage(WriteImage(dir, spec));
    const auto whole = imagery->ReadMercator(7, 65 * 256, 63 * 256, 256);
    const auto part = imagery->ReadMercator(7, 65 * 256 + 64, 63 * 256 + 128, 64);
    ASSERT_TRUE(whole && part);
    for (std::size_t y = 0; y < 64; ++y) {
      for (std::size_t i = 0; i < 4 * 64; ++i) {
        ASSERT_EQ(part->rgba[4 * 64 * y + i], whole->rgba[4 * (256 * (y + 128) + 64) + i]);
      }
    }
    EXPECT_NEAR(whole->rgba[4 * (256 * 128 + 128)], 100, 2) << "not one of the pixels";
  }
}

// Writes 0xFF over the stored blocks that contain a column, so that they cannot be decoded.
void DamageColumn(const std::string& path, int column) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks;
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
    GDALRasterBand& band = *dataset->GetRasterBand(1);
    int width = 0, height = 0;
    band.GetBlockSize(&width, &height);
    for (int row = 0; row * height < band.GetYSize(); ++row) {
      const auto number = [&](const std::string& what) {
        const std::string item = what + std::to_string(column / width) + "_" + std::to_string(row);
        return std::strtoull(band.GetMetadataItem(item.c_str(), "TIFF"), nullptr, 10);
      };
      blocks.emplace_back(number("BLOCK_OFFSET_"), number("BLOCK_SIZE_"));
    }
  }
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  for (const auto& [offset, bytes] : blocks) {
    file.seekp(static_cast<std::streamoff>(offset));
    file << std::string(bytes, '\xff');
  }
}

TEST(Imagery, ATileAcrossTheEndsOfAnImageAroundTheEarthReadsNothingBetween) {
  const TempDir dir;
  ImageSpec spec;
  spec.width = 720;
  spec.height = 360;
  spec.geo_transform = {-20, 0.5, 0, 90, 0, -0.5};
  spec.color = [](int column, int) { return Color{column / 3, 100, 7}; };
  const std::string plain = WriteImage(dir, spec), path = dir.File("tiled.tif");
  {
    const char* const options[] = {"TILED=YES", "BLOCKXSIZE=64", "BLOCKYSIZE=64", "COMPRESS=DEFLATE", nullptr};
    const GDALDatasetUniquePtr from(GDALDataset::Open(plain.c_str()));
    GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    GDALClose(driver->CreateCopy(path.c_str(), from.get(), FALSE, const_cast<char**>(options), nullptr, nullptr));
  }
  DamageColumn(path, 360);
  const auto imagery = OpenImage(path);
  // 22.5 to 0 degrees west: the image's last 2.5 degrees, then its first 20.
  const auto picture = ReadOrFail(*imagery, {3, 7, 4}, 256);
  ASSERT_TRUE(picture.has_value());
  EXPECT_NEAR(At(*picture, 100, 5)[0], 238, 1);
  EXPECT_NEAR(At(*picture, 100, 253)[0], 13, 1);
  // The other side of the Earth shows that blocks are damaged.
  EXPECT_FALSE(imagery->Read({3, 15, 4}, 256).has_value());
}

TEST(Imagery, AnImageOfAnotherPlaceIsRefused) {
  const TempDir dir;
  const auto refused = Imagery::Open(WriteImage(dir, TileSpec()), {-80, 20, -70, 30});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find("nothing of the dataset"), std::string::npos) << refused.error().message;
}

TEST(Imagery, ARasterOfHeightsIsRefused) {
  const TempDir dir;
  const auto refused = Imagery::Open(WriteRaster(dir, {}), {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message.find("colours must be unsigned, of 8 or 16 bits"), std::string::npos)
      << refused.error().message;
}

TEST(Imagery, SaysWhenItsFileChanged) {
  const TempDir dir;
  const std::string path = WriteImage(dir, TileSpec());
  const auto imagery = OpenImage(path);
  const std::uint64_t before = imagery->fingerprint();
  std::filesystem::resize_file(path, 1000);
  EXPECT_EQ(imagery->Read(kTile, 256).error().code, ErrorCode::kChanged);
  WriteImage(dir, TileSpec(2));
  EXPECT_NE(OpenImage(path)->fingerprint(), before);
}

TEST(Imagery, StopsWhenAsked) {
  const TempDir dir;
  ImageSpec spec = TileSpec();
  spec.color = [](int column, int row) { return Color{column, row, 0}; };
  const auto imagery = OpenImage(WriteImage(dir, spec));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(imagery->Read(kTile, 256, stop.get_token()).error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace terrace::dem
