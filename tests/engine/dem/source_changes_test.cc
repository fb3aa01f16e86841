// A source that changed under the server gives an error, never a flat or a mixed tile.
#include <fstream>

#include "engine/dem/source_policy.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr geo::TileKey kInside{5, 34, 13};

void ExpectUnavailable(const DemSource& source) {
  const auto tile = source.Read(kInside);
  ASSERT_FALSE(tile);
  EXPECT_EQ(tile.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(tile.error().message.find("dem.tif"), std::string::npos);
}

TEST(SourceChanges, RemovedFileIsUnavailable) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  ASSERT_TRUE(source->Read(kInside));
  std::filesystem::remove(path);
  ExpectUnavailable(*source);
}

TEST(SourceChanges, ReplacedFileIsUnavailable) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  ASSERT_TRUE(source->Read(kInside));
  std::filesystem::rename(WriteRaster(dir, {.value = [](int, int) { return 5.0; }}, "new.tif"), path);
  ExpectUnavailable(*source);
}

TEST(SourceChanges, OverwrittenFileIsUnavailableAndStaysSo) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  std::ofstream(path, std::ios::app) << "x";
  ExpectUnavailable(*source);
  ExpectUnavailable(*source);
}

TEST(SourceChanges, ChangedPartOfAMosaicIsUnavailable) {
  const TempDir dir;
  const std::string part = WriteRaster(dir, {}, "part.tif");
  std::ofstream(dir.File("dem.vrt")) << R"(<VRTDataset rasterXSize="16" rasterYSize="16"><SRS>EPSG:4326</SRS>
    <GeoTransform>0, 1, 0, 0, 0, -1</GeoTransform><VRTRasterBand dataType="Float32" band="1">
    <SimpleSource><SourceFilename relativeToVRT="1">part.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource>
    </VRTRasterBand></VRTDataset>)";
  ASSERT_TRUE(SetSourcePolicy({.drivers = {"VRT", "GTiff"}}));
  const auto source = OpenOrFail(dir.File("dem.vrt"));
  ASSERT_NE(source, nullptr);
  ASSERT_TRUE(source->Read(kInside));
  std::filesystem::remove(part);
  const auto tile = source->Read(kInside);
  ASSERT_TRUE(SetSourcePolicy({}));
  ASSERT_FALSE(tile);
  EXPECT_EQ(tile.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace terrace::dem
