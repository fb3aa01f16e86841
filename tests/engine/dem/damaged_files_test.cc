// Truncated, flipped and overwritten files are rejected or read, each in a separate process. None crashes, hangs or
// takes unbounded memory.
#include <gdal_priv.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "engine/image/water_raster.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/support/resident_memory.h"

namespace terrace::dem {
namespace {

constexpr int kFiles = test_support::kSanitized ? 60 : 500;  // processes start slowly under a sanitizer
constexpr unsigned kSeconds = 20;                            // the target is 5 on an idle machine
// In addition to the parent's memory, because sanitizers keep memory that earlier tests have freed.
constexpr long kMaxKib = 512 << 10;

std::string ReadFile(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

std::string Damaged(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t bound) {
    return std::uniform_int_distribution<std::size_t>(0, bound - 1)(random);
  };
  const std::size_t head = std::min<std::size_t>(bytes.size(), 600);
  switch (below(4)) {
    case 0:
      bytes.resize(below(bytes.size()));
      break;
    case 1:  // makes numbers in the header large
      for (int i = 0; i < 3; ++i) bytes[below(head)] = static_cast<char>(0xff);
      break;
    case 2:
      for (std::size_t i = 0, flips = 1 + below(20); i < flips; ++i) {
        bytes[below(below(2) == 0 ? head : bytes.size())] ^= static_cast<char>(1 << below(8));
      }
      break;
    default:
      for (std::size_t at = below(bytes.size()), end = std::min(at + 64, bytes.size()); at < end; ++at) {
        bytes[at] = static_cast<char>(below(256));
      }
  }
  return bytes;
}

// Never returns.
void OpenAndRead(const std::string& path) {
  ::alarm(kSeconds);
  const auto source = ElevationModel::Open(path);
  if (source) {
    for (const int level : {0, (*source)->max_level() / 2, (*source)->max_level()}) {
      for (const geo::TileKey& key : SomeTiles(**source, level, 2)) static_cast<void>((*source)->Read(key));
    }
  }
  ::_exit(0);
}

TEST(DamagedFiles, CrashHangAndSwellNothing) {
  const TempDir dir;
  RasterSpec spec{
      .width = 60, .height = 50, .type = "Int16", .geo_transform = {8, .001, 0, 47, 0, -.001}, .nodata = -7};
  spec.value = [](int col, int row) { return 300 + col * 7 % 90 + row; };
  std::vector<std::pair<std::string, std::string>> seeds = {{"plain.tif", ReadFile(WriteRaster(dir, spec))}};
  const GDALDatasetUniquePtr plain(GDALDataset::Open(dir.File("dem.tif").c_str()));
  ASSERT_NE(plain, nullptr);
  const char* const tiled[] = {"TILED=YES",        "BLOCKXSIZE=16", "BLOCKYSIZE=16",
                               "COMPRESS=DEFLATE", "PREDICTOR=2",   nullptr};
  const struct {
    const char *driver, *name;
    const char* const* options;
  } kForms[] = {{"GTiff", "tiled.tif", tiled}, {"AAIGrid", "text.asc", nullptr}, {"PNG", "picture.png", nullptr}};
  for (const auto& form : kForms) {
    GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName(form.driver);
    ASSERT_NE(driver, nullptr) << form.driver;
    driver
        ->CreateCopy(dir.File(form.name).c_str(), plain.get(), FALSE, const_cast<char**>(form.options), nullptr,
                     nullptr)
        ->ReleaseRef();
    seeds.emplace_back(form.name, ReadFile(dir.File(form.name)));
    ASSERT_FALSE(seeds.back().second.empty()) << form.driver;
  }
  std::mt19937 random(20);
  int opened_badly = 0;
  for (int i = 0; i < kFiles; ++i) {
    const auto& [name, bytes] = seeds[static_cast<std::size_t>(i) % seeds.size()];
    const std::string path = dir.File("damaged_" + name);
    std::ofstream(path, std::ios::binary) << Damaged(bytes, random);
    const long before = test_support::ResidentKib();
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) OpenAndRead(path);
    int status = 0;
    rusage used{};
    ASSERT_EQ(::wait4(child, &status, 0, &used), child);
    const long grown = used.ru_maxrss - before;
    const bool fine = WIFEXITED(status) && WEXITSTATUS(status) == 0 && grown < kMaxKib;
    EXPECT_TRUE(fine) << "file " << i << " from " << name << ": status " << status << ", +" << grown << " KiB";
    opened_badly += !fine;
    ASSERT_LT(opened_badly, 5) << "enough seen";
  }
  RecordProperty("files", kFiles);
}

// The overviews and the mask at the end of the file may be damaged as well as the samples.
TEST(DamagedFiles, WhatBelongsToAGeoTiffMayBeCutToo) {
  const TempDir dir;
  RasterSpec spec{.width = 600, .height = 400, .type = "Byte", .geo_transform = {8, .001, 0, 47, 0, -.001}};
  spec.value = [](int col, int row) { return (col * 7 + row) % 200; };
  const std::string plain = WriteRaster(dir, spec);
  const GeoBounds around = (*ElevationModel::Open(plain))->info().bounds;
  const auto copy = [&](const std::string& name, bool has_mask) {
    const std::string path = dir.File(name);
    std::filesystem::copy_file(plain, path);
    CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", "YES");
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    int factor = 2;
    const auto done = has_mask ? dataset->CreateMaskBand(GMF_PER_DATASET)
                               : dataset->BuildOverviews("AVERAGE", 1, &factor, 0, nullptr, nullptr, nullptr);
    EXPECT_EQ(done, CE_None);
    if (has_mask) {
      EXPECT_EQ(dataset->GetRasterBand(1)->GetMaskBand()->Fill(255), CE_None);
    }
    CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", nullptr);
    return path;
  };
  for (const std::string& path : {copy("overviews.tif", false), copy("mask.tif", true)}) {
    const auto whole = WaterRaster::Open(path, around);
    ASSERT_TRUE(whole) << whole.error().message;
    const std::string bytes = ReadFile(path);
    std::ofstream(path, std::ios::binary) << bytes.substr(0, bytes.size() - 40);
    const auto mask = WaterRaster::Open(path, around);
    ASSERT_FALSE(mask) << path;
    EXPECT_NE(mask.error().message.find("is cut short"), std::string::npos) << mask.error().message;
  }
}

// For uncompressed samples libraries read the rows of the last strip, whatever its stated size.
TEST(DamagedFiles, AStripMayStateMoreThanItHas) {
  const TempDir dir;
  RasterSpec spec{.width = 600, .height = 200, .type = "Int16", .geo_transform = {8, .001, 0, 47, 0, -.001}};
  spec.value = [](int col, int row) { return col + row; };
  const std::string path = WriteRaster(dir, spec);
  const GDALDatasetUniquePtr plain(GDALDataset::Open(path.c_str()));
  const char* const options[] = {"BLOCKYSIZE=64", nullptr};
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  const std::string strips = dir.File("strips.tif");
  driver->CreateCopy(strips.c_str(), plain.get(), FALSE, const_cast<char**>(options), nullptr, nullptr)->ReleaseRef();
  std::string bytes = ReadFile(strips);
  // StripByteCounts of 64 rows three times, then of the 8 that are left.
  const std::uint32_t of_whole = 64 * 600 * 2, of_last = 8 * 600 * 2;
  const std::uint32_t counts[] = {of_whole, of_whole, of_whole, of_last};
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(counts), sizeof counts));
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at + 12, 4, reinterpret_cast<const char*>(&of_whole), 4);
  std::ofstream(strips, std::ios::binary) << bytes;
  const auto source = ElevationModel::Open(strips);
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_EQ((*source)->info().heights.max, 798);
}

// Opening must report it, because reading a tile far from the end of the file would not.
TEST(DamagedFiles, AGeoTiffThatIsCutShortIsToldWhenItIsOpened) {
  const TempDir dir;
  RasterSpec spec{.width = 300, .height = 200, .geo_transform = {8, .001, 0, 47, 0, -.001}};
  spec.value = [](int col, int row) { return col % 90 + row; };
  const std::string path = WriteRaster(dir, spec), bytes = ReadFile(path);
  const GeoBounds around = (*ElevationModel::Open(path))->info().bounds;
  ASSERT_TRUE(WaterRaster::Open(path, around));
  for (const std::size_t lost : {bytes.size() / 2, std::size_t{1}}) {
    std::ofstream(path, std::ios::binary) << bytes.substr(0, bytes.size() - lost);
    const auto source = ElevationModel::Open(path);
    const auto mask = WaterRaster::Open(path, around);
    ASSERT_FALSE(source);
    ASSERT_FALSE(mask);
    for (const Error& error : {source.error(), mask.error()}) {
      EXPECT_EQ(error.code, ErrorCode::kUnavailable);
      EXPECT_NE(error.message.find("is cut short"), std::string::npos) << error.message;
    }
  }
}

TEST(DamagedFiles, BlocksCountWithTheBandsTheyAreStoredWith) {
  const TempDir dir;
  GDALAllRegister();
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  const char* const options[] = {"SPARSE_OK=TRUE",  "TILED=YES",        "BLOCKXSIZE=1024",
                                 "BLOCKYSIZE=1024", "INTERLEAVE=PIXEL", nullptr};
  GDALDatasetUniquePtr(
      driver->Create(dir.File("bands.tif").c_str(), 1024, 1024, 60, GDT_Float32, const_cast<char**>(options)));
  const auto refused = ElevationModel::Open(dir.File("bands.tif"));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("too large to read tiles from"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace terrace::dem
