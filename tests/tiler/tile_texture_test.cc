// Textures of GLB tiles, from the image to the client's decoder.

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/proto/glb_decoder.h"
#include "tests/support/scratch_directory.h"
#include "tests/tiler/fetched_tile.h"

namespace terrace::tiler {
namespace {

// The Earth from 80 W to 80 E, a degree a pixel: red in the west, green in the east.
std::string WriteHalves() {
  GDALAllRegister();
  static const test_support::ScratchDirectory scratch;
  const std::string path = scratch.path() / "halves.tif";
  GDALDatasetUniquePtr dataset(
      GetGDALDriverManager()->GetDriverByName("GTiff")->Create(path.c_str(), 160, 180, 3, GDT_Byte, nullptr));
  double transform[] = {-80, 1, 0, 90, 0, -1};
  dataset->SetGeoTransform(transform);
  OGRSpatialReference srs;
  srs.SetWellKnownGeogCS("WGS84");
  dataset->SetSpatialRef(&srs);
  for (int band = 0; band < 3; ++band) {
    std::vector<std::uint8_t> line;
    for (int column = 0; column < 160; ++column) line.push_back(band == (column < 80 ? 0 : 1) ? 240 : 10);
    for (int row = 0; row < 180; ++row) {
      EXPECT_EQ(dataset->GetRasterBand(band + 1)->RasterIO(GF_Write, 0, row, 160, 1, line.data(), 160, 1, GDT_Byte, 0,
                                                           0, nullptr),
                CE_None);
    }
  }
  return path;
}

const TilePipeline& Earth() {
  static const TilePipeline* const pipeline = [] {
    std::vector<Dataset> datasets;
    datasets.push_back(OpenSample("etopo5"));
    auto image = dem::Imagery::Open(WriteHalves(), datasets[0].model->info().bounds);
    EXPECT_TRUE(image.has_value()) << (image ? "" : image.error().message);
    if (image) datasets[0].imagery.image = *std::move(image);
    datasets[0].attribution = "a survey";
    datasets[0].imagery.side = 128;
    datasets[0].imagery.attribution = "halves";
    return new TilePipeline(std::move(datasets));
  }();
  return *pipeline;
}

TileRequest GlbRequest(geo::TileKey key, proto::TextureFormat texture) {
  TileRequest request;
  request.key = key;
  request.format = TileFormat::kGlb;
  request.texture = texture;
  return request;
}

proto::DecodedGlb Fetch(const TileRequest& request) {
  const auto tile = Earth().Build(request, {});
  EXPECT_TRUE(tile.has_value()) << (tile ? "" : tile.error().message);
  return tile ? proto::DecodeGlb(tile->bytes).value_or(proto::DecodedGlb{}) : proto::DecodedGlb{};
}

// Red, green and blue at the centre of an image, read by GDAL.
std::vector<int> MiddleColor(std::string bytes, int side) {
  const std::string name = "/vsimem/tile_texture_test";
  VSIFCloseL(VSIFileFromMemBuffer(name.c_str(), reinterpret_cast<GByte*>(bytes.data()), bytes.size(), FALSE));
  GDALDatasetUniquePtr dataset(GDALDataset::Open(name.c_str()));
  std::vector<int> color;
  if (!dataset || dataset->GetRasterXSize() != side || dataset->GetRasterYSize() != side) return color;
  for (int band = 1; band <= 3; ++band) {
    std::uint8_t level = 0;
    EXPECT_EQ(dataset->GetRasterBand(band)->RasterIO(GF_Read, side / 2, side / 2, 1, 1, &level, 1, 1, GDT_Byte, 0, 0,
                                                     nullptr),
              CE_None);
    color.push_back(level);
  }
  return color;
}

TEST(TileTexture, ShowsTheImageOfThePlace) {
  for (const proto::TextureFormat format : {proto::TextureFormat::kJpeg, proto::TextureFormat::kWebp}) {
    const proto::DecodedGlb west = Fetch(GlbRequest({2, 3, 2}, format)), east = Fetch(GlbRequest({2, 4, 2}, format));
    const std::vector<int> red = MiddleColor(west.image, 128), green = MiddleColor(east.image, 128);
    ASSERT_TRUE(red.size() == 3 && green.size() == 3);
    EXPECT_GT(red[0], 200);
    EXPECT_LT(red[1], 50);
    EXPECT_GT(green[1], 200);
    EXPECT_LT(green[0], 50);
    EXPECT_EQ(west.json.at("asset").at("copyright"), "a survey; halves");
  }
}

TEST(TileTexture, IsLeftOutWhereThereIsNoPictureOrNoneIsWanted) {
  EXPECT_TRUE(Fetch(GlbRequest({2, 0, 2}, proto::TextureFormat::kJpeg)).image.empty()) << "beyond the image";
  const proto::DecodedGlb bare = Fetch(GlbRequest({2, 3, 2}, proto::TextureFormat::kNone));
  EXPECT_TRUE(bare.image.empty());
  EXPECT_EQ(bare.json.at("asset").at("copyright"), "a survey") << "the ground has its credit without a picture too";
  TileRequest terrain = GlbRequest({2, 3, 2}, proto::TextureFormat::kNone);
  terrain.format = TileFormat::kQuantizedMesh;
  const auto plain = Earth().Build(terrain, {});
  ASSERT_TRUE(plain.has_value());
}

TEST(TileTexture, ChangesTheETagAndNothingOfTheSurface) {
  const TileRequest textured = GlbRequest({3, 7, 5}, proto::TextureFormat::kJpeg);
  const TileRequest plain = GlbRequest({3, 7, 5}, proto::TextureFormat::kNone);
  EXPECT_NE(Earth().Build(textured, {})->etag, Earth().Build(plain, {})->etag);
  EXPECT_EQ(Earth().Build(textured, {})->bytes, Earth().Build(textured, {})->bytes);
  EXPECT_EQ(Surface(Fetch(textured)), Surface(Fetch(plain)));
}

}  // namespace
}  // namespace terrace::tiler
