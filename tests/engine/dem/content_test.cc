// The hash of a dataset's content: it is equal for every copy of the files, and differs if anything differs that
// determines heights.
#include <gdal_priv.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "engine/gdal/file_content.h"
#include "engine/gdal/stamped_files.h"
#include "engine/image/imagery.h"
#include "engine/image/water_raster.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/geoid_grids.h"

namespace terrace::dem {
namespace {

namespace fs = std::filesystem;

// More than one chunk in both directions, with a hole.
RasterSpec Ground() {
  RasterSpec spec;
  spec.width = 1100;
  spec.height = 1050;
  spec.geo_transform = {8, .001, 0, 47, 0, -.001};
  spec.nodata = -9999;
  spec.value = [](int c, int r) { return c > 300 && c < 310 && r == 200 ? -9999 : 500 + (c * 31 + r * 17) % 89; };
  return spec;
}

RasterSpec WithChange(RasterSpec spec, int column, int row, double value) {
  spec.value = [value_of = spec.value, column, row, value](int c, int r) {
    return c == column && r == row ? value : value_of(c, r);
  };
  return spec;
}

// Copies the file, with another inode and time.
std::string CopyOf(const std::string& path, const TempDir& to) {
  const fs::path copy = to.path() / fs::path(path).filename();
  fs::copy_file(path, copy);
  fs::last_write_time(copy, fs::last_write_time(path) - std::chrono::hours(1000));
  return copy.string();
}

std::uint64_t Fingerprint(const std::string& path, const DemOptions& options = {}) {
  const auto source = OpenOrFail(path, options);
  return source ? source->fingerprint() : 0;
}

TEST(Content, ACopyHasTheSameWithAndWithoutACache) {
  const TempDir here, there;
  const std::string path = WriteRaster(here, Ground()), copy = CopyOf(path, there);
  const std::uint64_t expected = Fingerprint(path);
  EXPECT_EQ(Fingerprint(copy), expected);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(Fingerprint(copy, {.cache = CacheIn(there.File("cache"))}), expected) << i;
}

TEST(Content, StorageOfTheFileMakesNoDifference) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Ground());
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
  const char* const options[] = {"TILED=YES", "COMPRESS=DEFLATE", nullptr};
  GDALDatasetUniquePtr(GetGDALDriverManager()->GetDriverByName("GTiff")->CreateCopy(
      dir.File("tiled.tif").c_str(), dataset.get(), true, const_cast<char**>(options), nullptr, nullptr));
  EXPECT_EQ(Fingerprint(dir.File("tiled.tif")), Fingerprint(path));
}

TEST(Content, EverySampleCounts) {
  const TempDir dir;
  const std::uint64_t expected = Fingerprint(WriteRaster(dir, Ground()));
  int i = 0;
  for (const auto& [column, row] : {std::pair{0, 0}, {1099, 1049}, {1024, 1023}, {1023, 1024}, {500, 600}}) {
    const std::string name = std::to_string(i++) + ".tif";
    EXPECT_NE(Fingerprint(WriteRaster(dir, WithChange(Ground(), column, row, 501.5), name)), expected) << column;
  }
  EXPECT_NE(Fingerprint(WriteRaster(dir, WithChange(Ground(), 305, 200, 500), "void.tif")), expected);
  // The same values at exchanged positions.
  RasterSpec swapped = WithChange(WithChange(Ground(), 5, 5, Ground().value(1050, 5)), 1050, 5, Ground().value(5, 5));
  EXPECT_NE(Fingerprint(WriteRaster(dir, swapped, "swapped.tif")), expected);
}

TEST(Content, WhatMakesHeightsOfSamplesCounts) {
  const TempDir dir;
  const std::uint64_t expected = Fingerprint(WriteRaster(dir, Ground()));
  auto differs = [&, i = 0](RasterSpec spec) mutable {
    return Fingerprint(WriteRaster(dir, spec, std::to_string(i++) + ".tif")) != expected;
  };
  RasterSpec spec = Ground();
  spec.scale = 1.5;
  EXPECT_TRUE(differs(spec)) << "scale";
  spec = Ground();
  spec.offset = 1;
  EXPECT_TRUE(differs(spec)) << "offset";
  spec = Ground();
  spec.unit = "foot";
  EXPECT_TRUE(differs(spec)) << "unit";
  spec = Ground();
  spec.nodata = -9998;
  EXPECT_TRUE(differs(spec)) << "nodata";
  spec = Ground();
  spec.geo_transform[0] += .001;
  EXPECT_TRUE(differs(spec)) << "place";
  spec = Ground();
  spec.geo_transform[5] *= 1.001;
  EXPECT_TRUE(differs(spec)) << "pixel";
  EXPECT_FALSE(differs(Ground()));

  const std::string path = WriteRaster(dir, Ground(), "again.tif");
  SourceOptions source;
  source.vertical = "ellipsoid";
  EXPECT_NE(Fingerprint(path, {.source = source}), expected) << "which heights those are is known";
  source.vertical = "crs";
  source.nodata = {510};
  EXPECT_NE(Fingerprint(path, {.source = source}), expected);
}

TEST(Content, AProjectedRasterIsPlacedByItsReferenceSystem) {
  const TempDir dir;
  RasterSpec spec = Ground();
  spec.geo_transform = {500'000, 30, 0, 5'200'000, 0, -30};
  spec.crs = "EPSG:32632";
  const std::uint64_t expected = Fingerprint(WriteRaster(dir, spec, "a.tif"));
  EXPECT_EQ(Fingerprint(WriteRaster(dir, spec, "b.tif")), expected);
  spec.crs = "EPSG:32633";
  EXPECT_NE(Fingerprint(WriteRaster(dir, spec, "c.tif")), expected);
}

TEST(Content, OverviewsThatAreReadCount) {
  const TempDir here, there, other;
  RasterSpec spec = Ground();
  spec.nodata = {};
  spec.value = [](int c, int r) { return 500 + (c * 31 + r * 17) % 89; };
  spec.overviews = {2, 4};
  const std::string path = WriteRaster(here, spec), copy = CopyOf(path, there), changed = CopyOf(path, other);
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(changed.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    float height = 0;
    GDALRasterBand& overview = *dataset->GetRasterBand(1)->GetOverview(1);
    ASSERT_EQ(overview.RasterIO(GF_Read, 7, 9, 1, 1, &height, 1, 1, GDT_Float32, 0, 0, nullptr), CE_None);
    height += .25f;
    ASSERT_EQ(overview.RasterIO(GF_Write, 7, 9, 1, 1, &height, 1, 1, GDT_Float32, 0, 0, nullptr), CE_None);
  }
  EXPECT_EQ(Fingerprint(copy), Fingerprint(path));
  EXPECT_NE(Fingerprint(changed), Fingerprint(path));
  spec.overviews = {};
  EXPECT_NE(Fingerprint(WriteRaster(here, spec, "bare.tif")), Fingerprint(path));
}

TEST(Content, TheOrderOfSourcesCountsAndTheNumberOfThreadsDoesNot) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int i = 0; i < 6; ++i) {
    const std::string name = std::to_string(i) + ".tif";
    files.push_back({WriteRaster(dir, FlatSquare(8 + .3 * i, 47, 200, .01, 100 + i), name), i, false, {}});
  }
  const std::uint64_t expected = OpenOrFail(files)->fingerprint();
  cpu_set_t before, one;
  ASSERT_EQ(::sched_getaffinity(0, sizeof(before), &before), 0);
  int core = 0;
  while (!CPU_ISSET(core, &before)) ++core;
  CPU_ZERO(&one);
  CPU_SET(core, &one);
  ASSERT_EQ(::sched_setaffinity(0, sizeof(one), &one), 0);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(OpenOrFail(files)->fingerprint(), expected);
  ASSERT_EQ(::sched_setaffinity(0, sizeof(before), &before), 0);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(OpenOrFail(files)->fingerprint(), expected);
  std::swap(files[2].rank, files[3].rank);
  EXPECT_NE(OpenOrFail(files)->fingerprint(), expected);
}

TEST(Content, TheBytesOfAGeoidGridCountAndItsPlaceDoesNot) {
  const TempDir here, there, other;
  const std::string path = WriteRaster(here, Ground());
  GtxSpec undulations;
  undulations.value = [](int, int) { return 40.0f; };
  const std::string grid = WriteGtx(here, "g.gtx", undulations), copy = CopyOf(grid, there);
  undulations.value = [](int c, int) { return c == 3 ? 40.5f : 40.0f; };
  const std::string changed = WriteGtx(other, "g.gtx", undulations);
  const auto above = [&](const std::string& geoid) {
    SourceOptions source;
    source.vertical = geoid;
    return Fingerprint(path, {.source = source});
  };
  EXPECT_EQ(above(copy), above(grid));
  EXPECT_NE(above(changed), above(grid));
  EXPECT_NE(above(grid), Fingerprint(path));
}

TEST(Content, MasksAndImagesCountByTheirBytesAndPlaces) {
  const TempDir here, there, other;
  RasterSpec spec;
  spec.type = "Byte";
  spec.width = spec.height = 64;
  spec.geo_transform = {8, .01, 0, 47, 0, -.01};
  spec.value = [](int c, int r) { return (c + r) % 3; };
  const std::string path = WriteRaster(here, spec), copy = CopyOf(path, there);
  const std::string changed = WriteRaster(other, WithChange(spec, 9, 9, 2), "changed.tif");
  const auto mask = [](const std::string& file) { return WaterRaster::Open(file, {}).value()->fingerprint(); };
  const auto image = [](const std::string& file) { return Imagery::Open(file, {}).value()->fingerprint(); };
  EXPECT_EQ(mask(copy), mask(path));
  EXPECT_NE(mask(changed), mask(path));
  EXPECT_EQ(image(copy), image(path));
  EXPECT_NE(image(changed), image(path));
}

// A sparse file, whose zeros take no disk space.
std::string WriteSparse(const TempDir& dir, const std::string& name, std::uintmax_t bytes) {
  std::ofstream(dir.File(name), std::ios::binary) << "begin";
  fs::resize_file(dir.File(name), bytes);
  return dir.File(name);
}

// Hashes in another process, so that this one has nothing in memory.
void HashElsewhere(const std::string& path, const std::string& cache) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(HashFiles(StampedFiles({path}), {cache, {}}) ? 0 : 1);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

// Bytes that this process has read.
std::uint64_t BytesRead() {
  std::ifstream io("/proc/self/io");
  std::string name;
  std::uint64_t bytes = 0;
  io >> name >> bytes;
  return bytes;
}

TEST(FileContent, LargeFilesAreReadOnceAndDamagedRecordsAreNotBelieved) {
  const TempDir dir;
  constexpr std::uintmax_t kBytes = std::uintmax_t{300} << 20;
  const std::string cache = dir.File("cache"), path = WriteSparse(dir, "a.img", kBytes);
  HashElsewhere(path, cache);
  const std::uint64_t before = BytesRead();
  const auto loaded = HashFiles(StampedFiles({path}), {cache, {}});
  EXPECT_LT(BytesRead() - before, 1 << 20) << "its record is there";
  ASSERT_TRUE(loaded);

  const std::string copy = WriteSparse(dir, "b.img", kBytes);
  HashElsewhere(copy, cache);
  for (const fs::directory_entry& record : fs::directory_iterator(cache)) {
    std::fstream file(record.path(), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(60);
    file.put('x');
  }
  EXPECT_EQ(*HashFiles(StampedFiles({copy}), {cache, {}}), *loaded) << "read again";
  EXPECT_GE(BytesRead() - before, kBytes);
  EXPECT_NE(*HashFiles(StampedFiles({WriteSparse(dir, "c.img", kBytes + 1)}), {cache, {}}), *loaded);
  EXPECT_EQ(std::distance(fs::directory_iterator(cache), {}), 3);
  ASSERT_TRUE(HashFiles(StampedFiles({WriteSparse(dir, "small.img", 1000)}), {cache, {}}));
  EXPECT_EQ(std::distance(fs::directory_iterator(cache), {}), 3) << "none of a small file";
}

TEST(FileContent, AChangedFileIsTold) {
  const TempDir dir;
  const std::string path = WriteSparse(dir, "a.img", 1000);
  const StampedFiles files({path});
  fs::resize_file(path, 1001);
  const auto hash = HashFiles(files);
  ASSERT_FALSE(hash);
  EXPECT_EQ(hash.error().code, ErrorCode::kChanged);
  fs::remove(path);
  EXPECT_EQ(HashFiles(files).error().code, ErrorCode::kUnavailable);
}

TEST(FileContent, StopsWhenAsked) {
  const TempDir dir;
  std::stop_source stop;
  stop.request_stop();
  const auto hash = HashFiles(StampedFiles({WriteSparse(dir, "a.img", 1000)}), {{}, stop.get_token()});
  ASSERT_FALSE(hash);
  EXPECT_EQ(hash.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace terrace::dem
