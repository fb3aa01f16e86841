// A source that changes while it is served gives an error, never a flat or a mixed tile.
#include <cpl_vsi.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "engine/gdal/source_policy.h"
#include "engine/gdal/stamped_files.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr geo::TileKey kInside{5, 34, 13};

void ExpectChanged(const ElevationModel& model) {
  const auto tile = model.Read(kInside);
  ASSERT_FALSE(tile);
  EXPECT_EQ(tile.error().code, ErrorCode::kChanged);
  EXPECT_NE(tile.error().message.find("dem.tif"), std::string::npos);
}

TEST(SourceChanges, RemovedFileIsTold) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  ASSERT_TRUE(source->Read(kInside));
  std::filesystem::remove(path);
  ExpectChanged(*source);
}

TEST(SourceChanges, ReplacedFileIsTold) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  ASSERT_TRUE(source->Read(kInside));
  std::filesystem::rename(WriteRaster(dir, {.value = [](int, int) { return 5.0; }}, "new.tif"), path);
  ExpectChanged(*source);
}

TEST(SourceChanges, OverwrittenFileIsToldAndStaysSo) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  std::ofstream(path, std::ios::app) << "x";
  ExpectChanged(*source);
  ExpectChanged(*source);
}

// Size and modification time are the same, but its statistics must not be used.
TEST(SourceChanges, OneOverwrittenInPlaceWithItsTimesKeptIsAnother) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {}),
                    other = WriteRaster(dir, {.value = [](int x, int y) { return x == 8 && y == 8 ? 5.0 : 0.0; }},
                                        "other.tif");  // as low as the first
  ASSERT_EQ(std::filesystem::file_size(path), std::filesystem::file_size(other));
  const auto time = std::filesystem::last_write_time(path);
  const DemOptions options{.cache = CacheIn(dir.File("cache"))};
  const auto before = OpenOrFail(path, options);
  ASSERT_NE(before, nullptr);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // clocks of file systems tick every 4 ms or so
  {
    std::ifstream from(other, std::ios::binary);
    std::fstream to(path, std::ios::binary | std::ios::in | std::ios::out);
    to << from.rdbuf();
  }
  std::filesystem::last_write_time(path, time);
  const auto after = OpenOrFail(path, options);
  ASSERT_NE(after, nullptr);
  EXPECT_NE(after->fingerprint(), before->fingerprint());
  EXPECT_EQ(after->info().sources.front().heights.max, 5);
}

TEST(SourceChanges, ChangedPartOfAMosaicIsTold) {
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
  EXPECT_EQ(tile.error().code, ErrorCode::kChanged);
}

// GDAL lists only the parts of the outermost VRT.
TEST(SourceChanges, ChangedPartOfAMosaicInAMosaicIsTold) {
  const TempDir dir;
  WriteRaster(dir, {}, "part.tif");
  const auto vrt_of = [&](const std::string& name, const std::string& part) {
    std::ofstream(dir.File(name)) << R"(<VRTDataset rasterXSize="16" rasterYSize="16"><SRS>EPSG:4326</SRS>
      <GeoTransform>0, 1, 0, 0, 0, -1</GeoTransform><VRTRasterBand dataType="Float32" band="1">
      <SimpleSource><SourceFilename relativeToVRT="1">)"
                                  << part << R"(</SourceFilename><SourceBand>1</SourceBand></SimpleSource>
      </VRTRasterBand></VRTDataset>)";
  };
  vrt_of("inner.vrt", "part.tif");
  vrt_of("dem.vrt", "inner.vrt");
  std::ofstream(dir.File("part.tif.aux.xml")) << "<PAMDataset></PAMDataset>";
  ASSERT_TRUE(SetSourcePolicy({.drivers = {"VRT", "GTiff"}}));
  const auto source = OpenOrFail(dir.File("dem.vrt"));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->files().size(), 4U);
  ASSERT_TRUE(source->Read(kInside));
  const std::uint64_t before = source->fingerprint();
  std::filesystem::rename(WriteRaster(dir, {.value = [](int, int) { return 5.0; }}, "new.tif"), dir.File("part.tif"));
  const auto tile = source->Read(kInside);
  const auto again = OpenOrFail(dir.File("dem.vrt"));
  ASSERT_TRUE(SetSourcePolicy({}));
  ASSERT_FALSE(tile);
  EXPECT_EQ(tile.error().code, ErrorCode::kChanged);
  ASSERT_NE(again, nullptr);
  EXPECT_NE(again->fingerprint(), before);
}

// Files of GDAL's file systems are distinguished by name, size and time.
TEST(SourceChanges, FilesElsewhereAreToldApart) {
  const auto put = [](const char* name, std::size_t size) {
    VSILFILE* const file = VSIFOpenL(name, "wb");
    ASSERT_NE(file, nullptr);
    const std::string bytes(size, 'x');
    EXPECT_EQ(VSIFWriteL(bytes.data(), 1, size, file), size);
    EXPECT_EQ(VSIFCloseL(file), 0);
  };
  const auto fingerprint = [](const char* name) { return StampedFiles({name}).fingerprint(); };
  put("/vsimem/a.tif", 10);
  put("/vsimem/b.tif", 10);
  const std::uint64_t first = fingerprint("/vsimem/a.tif");
  EXPECT_EQ(fingerprint("/vsimem/a.tif"), first);
  EXPECT_NE(fingerprint("/vsimem/b.tif"), first);
  EXPECT_EQ(StampedFiles({"/vsimem/a.tif"}).size(), 0U) << "none that can be watched";
  put("/vsimem/a.tif", 11);
  EXPECT_NE(fingerprint("/vsimem/a.tif"), first);
  VSIUnlink("/vsimem/a.tif");
  VSIUnlink("/vsimem/b.tif");
}

// When the old file comes back, handles of the new file must not be used.
TEST(SourceChanges, TheFileMayComeBack) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto source = OpenOrFail(path);
  const auto before = source->Read(kInside);
  ASSERT_TRUE(before);
  std::filesystem::rename(path, dir.File("old.tif"));
  std::filesystem::rename(WriteRaster(dir, {.value = [](int, int) { return 5.0; }}, "new.tif"), path);
  ExpectChanged(*source);
  std::filesystem::rename(dir.File("old.tif"), path);
  const auto after = source->Read(kInside);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->heights, before->heights);
}

TEST(SourceChanges, WhatWasReplacedWhileItWasOpenedIsToldApart) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const auto before = StampOf(path);
  EXPECT_TRUE(StampedFiles::OfOpened({path}, before));
  std::ofstream(path, std::ios::app) << "x";
  const auto files = StampedFiles::OfOpened({path}, before);
  ASSERT_FALSE(files);
  EXPECT_EQ(files.error().code, ErrorCode::kChanged);
}

TEST(SourceChanges, ListsTheFilesThatMatter) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, {}));
  const StampedFiles files = source->files();
  ASSERT_EQ(files.size(), 1u);
  EXPECT_FALSE(files.HasChanged(0));
  std::filesystem::remove(files.path(0));
  EXPECT_TRUE(files.HasChanged(0));
}

TEST(SourceChanges, OpeningCanBeStopped) {
  const TempDir dir;
  std::stop_source stop;
  stop.request_stop();
  DemOptions options;
  options.stop = stop.get_token();
  const auto source = ElevationModel::Open(WriteRaster(dir, {}), options);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace terrace::dem
