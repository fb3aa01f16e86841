// Water masks and images with a GDAL mask: what it hides stays hidden at every level, whether or not the overviews know
// the mask.
#include <cpl_conv.h>
#include <gdal_priv.h>

#include <string>
#include <vector>

#include "engine/image/imagery.h"
#include "engine/image/water_raster.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr geo::TileKey kMaskedTile{6, 65, 32};
constexpr int kFiner = 8;  // pixels of the raster along a side of the tile's

enum class MaskPlace { kInside, kBeside };
enum class OverviewPlace { kInside, kBeside };

// A raster of kMaskedTile without a zero, whose mask hides the western half.
std::string WriteHalfHidden(const TempDir& dir, MaskPlace mask, OverviewPlace overviews) {
  constexpr double kTile = 180.0 / 64;
  RasterSpec spec;
  spec.width = spec.height = 256 * kFiner;
  spec.type = "Byte";
  spec.geo_transform = {kTile, kTile / spec.width, 0, kTile, 0, -kTile / spec.width};
  spec.value = [](int, int) { return 200.0; };
  const std::string path = WriteRaster(dir, spec);
  CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", mask == MaskPlace::kInside ? "YES" : "NO");
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    EXPECT_EQ(dataset->CreateMaskBand(GMF_PER_DATASET), CE_None);
    std::vector<std::uint8_t> line(static_cast<std::size_t>(spec.width), 255);
    std::fill_n(line.begin(), spec.width / 2, 0);
    for (int row = 0; row < spec.height; ++row) {
      EXPECT_EQ(dataset->GetRasterBand(1)->GetMaskBand()->RasterIO(GF_Write, 0, row, spec.width, 1, line.data(),
                                                                   spec.width, 1, GDT_Byte, 0, 0, nullptr),
                CE_None);
    }
  }
  {
    const unsigned update = overviews == OverviewPlace::kInside ? GDAL_OF_UPDATE : 0;
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | update));
    const std::vector<int> factors = {2, 4, 8, 16};
    EXPECT_EQ(dataset->BuildOverviews("NEAREST", 4, factors.data(), 0, nullptr, GDALDummyProgress, nullptr), CE_None);
  }
  CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", nullptr);
  return path;
}

TEST(PictureMasks, HideTheSameWithOverviews) {
  for (const MaskPlace mask : {MaskPlace::kInside, MaskPlace::kBeside}) {
    for (const OverviewPlace overviews : {OverviewPlace::kInside, OverviewPlace::kBeside}) {
      SCOPED_TRACE(mask == MaskPlace::kInside ? "mask inside" : "mask beside");
      SCOPED_TRACE(overviews == OverviewPlace::kInside ? "overviews inside" : "overviews beside");
      const TempDir dir;
      const std::string path = WriteHalfHidden(dir, mask, overviews);
      const auto water = WaterRaster::Open(path, {});
      const auto image = Imagery::Open(path, {});
      ASSERT_TRUE(water && image);
      // From the full raster, and from three overviews.
      for (int level = kMaskedTile.level + 3; level >= kMaskedTile.level; --level) {
        SCOPED_TRACE(level);
        const int shift = level - kMaskedTile.level;
        const std::int64_t west = kMaskedTile.x << shift, y = kMaskedTile.y << shift, tiles = std::int64_t{1} << shift;
        for (const bool is_hidden : {true, false}) {
          // The first or the last column of tiles; in a single one, its first or last quarter.
          const geo::TileKey key{level, is_hidden ? west : west + tiles - 1, y};
          const std::size_t at = 128 * 256 + (is_hidden ? 64 : 192);
          const auto shares = (*water)->Read(key);
          ASSERT_TRUE(shares) << shares.error().message;
          EXPECT_EQ((*shares)[at], is_hidden ? 0 : 255);
          const auto picture = (*image)->ReadGeodetic(key, 256);
          ASSERT_TRUE(picture) << picture.error().message;
          EXPECT_EQ(picture->rgba[4 * at + 3], is_hidden ? 0 : 255);
        }
      }
    }
  }
}

}  // namespace
}  // namespace terrace::dem
