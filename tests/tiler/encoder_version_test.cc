// Clients and CDNs cache bytes by the version in the URL, so different bytes need a different version.
#include "tiler/encoder_version.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "proto/format_error_up.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/area/area_mesh.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::tiler {
namespace {

// Recorded results for the sample datasets. If bytes change on purpose, raise kEncoderVersion and copy the values that
// the test prints.
constexpr int kRecordedVersion = 11;
constexpr const char* kRecordedWith =
    "encoder 11, GDAL 3.6.2, PROJ 9.1.1, Draco 1.5.5, meshoptimizer 180, libjpeg 62, libwebp 10204, libdeflate 1.14, "
    "zlib 1.2.13, brotli 1000009, zstd 1.5.4";
constexpr const char* kRecordedBytes = "\"19133c555765ba046b68bbf6b53656ca\"";
constexpr const char* kRecordedMapBytes = "\"c9f2e3480baa79a7a914545e7ab3576b\"";
constexpr const char* kRecordedProjectedBytes = "\"fc7a54709526dfdc2161b29ff4187ebf\"";
constexpr const char* kRecordedFingerprints = "8b7add135baad482 78be5df43144e3b3 ";

// One tile near the middle of the data at some levels of both samples, in every format.
std::string TilesText(const TilePipeline& pipeline) {
  std::string text;
  const auto add = [&](const Result<EncodedTile>& tile) {
    ASSERT_TRUE(tile) << tile.error().message;
    text += fmt::format("{} {} {}\n", StrongETag(tile->bytes), proto::FormatErrorUp(tile->max_error_m),
                        proto::FormatErrorUp(tile->certified_error_m.value_or(0)));
  };
  for (std::uint32_t dataset = 0; dataset < pipeline.datasets().size(); ++dataset) {
    const dem::ElevationModel& model = *pipeline.datasets()[dataset].model;
    for (int level = 0; level <= model.max_level(); level += 3) {
      TileRequest request;
      request.dataset = dataset;
      const geo::TileRange& range = model.Available(level).front();
      request.key = {level, (range.start_x + range.end_x) / 2, (range.start_y + range.end_y) / 2};
      for (const int step : {-4, 0, 3}) {
        request.error_step = step;
        request.format = TileFormat::kQuantizedMesh;
        for (const bool normals : {false, true}) {
          request.extensions.normals = normals;
          add(pipeline.Build(request, {}));
        }
        request.format = TileFormat::kGlb;
        for (const auto compression : {proto::GlbCompression::kDraco, proto::GlbCompression::kNone,
                                       proto::GlbCompression::kQuantized, proto::GlbCompression::kMeshopt}) {
          request.compression = compression;
          add(pipeline.Build(request, {}));
        }
      }
      request.format = TileFormat::kQuantizedMesh;
      for (const Coding coding : kCodings) {
        request.coding = coding;
        add(pipeline.Build(request, {}));
      }
      const dem::HeightRange bound = model.RangeBound(request.key);
      text += fmt::format("{} {}\n", bound.min, bound.max);
    }
    TileRequest heights;
    heights.dataset = dataset;
    heights.format = TileFormat::kHeightPng;
    for (const auto encoding : {proto::HeightEncoding::kMapbox, proto::HeightEncoding::kTerrarium}) {
      heights.height_encoding = encoding;
      add(pipeline.Build(heights, {}));
    }
  }
  const dem::ElevationModel& model = *pipeline.datasets().back().model;
  const AreaRequest area{-84.25, 36.25, -84.2, 36.29, 5};
  const auto plan = PlanArea(model, 0.5, area, 1'000'000);
  EXPECT_TRUE(plan);
  if (plan) add(BuildAreaMesh(model, *plan, area, {}));
  const auto points = model.ReadPoints(std::vector<dem::GeoPosition>{{-84.2, 36.3}, {-84.217, 36.3181}});
  EXPECT_TRUE(points);
  if (points) text += fmt::format("{}\n", fmt::join(*points, " "));
  return text;
}

TEST(EncoderVersion, IsRaisedWithTheBytes) {
  const TilePipeline& pipeline = SamplePipeline();
  const std::string bytes = StrongETag(TilesText(pipeline));
  ASSERT_EQ(kEncoderVersion, kRecordedVersion)
      << "write down here what this version gives: " << kEncoderVersion << ", " << EncoderText() << ", " << bytes;
  if (EncoderText() != kRecordedWith) {
    GTEST_SKIP() << "SKIPPED, recorded with other libraries, which count by themselves: " << EncoderText() << ", "
                 << bytes;
  }
  EXPECT_EQ(bytes, kRecordedBytes) << "other bytes need another version: raise kEncoderVersion";
}

// Tiles for maps, of the second sample.
TEST(EncoderVersion, IsRaisedWithTheBytesOfMapTiles) {
  std::string text;
  for (const TileFormat format : {TileFormat::kHillshade, TileFormat::kSlope, TileFormat::kContours}) {
    for (const auto picture : {proto::PictureFormat::kPng, proto::PictureFormat::kWebp}) {
      TileRequest request;
      request.dataset = 1;
      request.format = format;
      request.key = {8, 67, 100};
      request.map.picture = picture;
      request.map.interval_cm = 10'000;
      const auto tile = SamplePipeline().Build(request, {});
      ASSERT_TRUE(tile) << tile.error().message;
      text += StrongETag(tile->bytes);
    }
  }
  if (EncoderText() != kRecordedWith) GTEST_SKIP() << "SKIPPED, recorded with other libraries: " << EncoderText();
  EXPECT_EQ(StrongETag(text), kRecordedMapBytes) << "other bytes need another version: raise kEncoderVersion";
}

// Tiles of a raster around a pole: its nodes are placed by PROJ and interpolation, which is coarsest at low levels.
TEST(EncoderVersion, IsRaisedWithTheBytesOfProjectedTiles) {
  const dem::TempDir dir;
  dem::RasterSpec spec;
  spec.width = spec.height = 500;
  spec.geo_transform = {-1.25e6, 5000, 0, 1.25e6, 0, -5000};
  spec.crs = "EPSG:3031";
  spec.value = [](int column, int row) { return (column * column + 3 * row * column) % 4001 / 8.0 + row; };
  std::vector<Dataset> datasets;
  datasets.push_back(OpenDataset("pole", dem::WriteRaster(dir, spec)));
  ASSERT_NE(datasets.front().model, nullptr);
  const dem::ElevationModel& model = *datasets.front().model;
  const TilePipeline pipeline(datasets);
  std::string text;
  for (int level = 0; level <= std::min(model.max_level(), 4); ++level) {
    const geo::TileRange& range = model.Available(level).front();
    for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
      TileRequest request;
      request.key = {level, x, range.start_y};
      request.error_step = -12;
      const auto tile = pipeline.Build(request, {});
      ASSERT_TRUE(tile) << tile.error().message;
      // Most differences of heights are smaller than the steps of these tiles.
      const auto read = model.Read(request.key);
      ASSERT_TRUE(read) << read.error().message;
      const std::string_view heights(reinterpret_cast<const char*>(read->heights.data()),
                                     read->heights.size() * sizeof(float));
      text += StrongETag(tile->bytes) + StrongETag(heights);
    }
  }
  if (EncoderText() != kRecordedWith) GTEST_SKIP() << "SKIPPED, recorded with other libraries: " << EncoderText();
  EXPECT_EQ(StrongETag(text), kRecordedProjectedBytes) << "other bytes need another version: raise kEncoderVersion";
}

// Otherwise every deployment would invalidate its CDN.
TEST(EncoderVersion, FingerprintsOfUnchangedSourcesStay) {
  std::string text;
  for (const Dataset& dataset : SamplePipeline().datasets()) {
    text += fmt::format("{:016x} ", dataset.model->fingerprint());
  }
  EXPECT_EQ(text, kRecordedFingerprints);
}

TEST(EncoderVersion, NamesTheLibrariesThatDecideBytes) {
  for (const char* library :
       {"GDAL ", "PROJ ", "Draco ", "meshoptimizer ", "libjpeg ", "libdeflate ", "brotli ", "zstd "}) {
    EXPECT_NE(EncoderText().find(library), std::string::npos) << EncoderText();
  }
}

TEST(EncoderVersion, TheTextOfAGenerationIsItsFirstTwelveDigits) {
  EXPECT_EQ(VersionText(0x0a1b2c3d4e5f6789), "0a1b2c3d4e5f");
  EXPECT_EQ(VersionText(0), "000000000000");
  EXPECT_TRUE(IsVersionOf("0a1b2c3d4e5f", 0x0a1b2c3d4e5f6789));
  for (const char* other : {"", "0", "0a1b2c3d4e5e", "0A1B2C3D4E5F", "0a1b2c3d4e5f6789", "a1b2c3d4e5f"}) {
    EXPECT_FALSE(IsVersionOf(other, 0x0a1b2c3d4e5f6789)) << other;
  }
}

}  // namespace
}  // namespace terrace::tiler
