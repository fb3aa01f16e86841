// Several threads read the same object, or compute the statistics of rasters. ThreadSanitizer runs this program.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/crs/geoid.h"
#include "engine/image/imagery.h"
#include "engine/image/water_raster.h"
#include "engine/sources/raster_source.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr geo::TileKey kTile{6, 65, 32};

// Runs `read` on four threads at once, and expects of each what it returned alone.
template <typename Read>
void ExpectSameOnFourThreads(const Read& read) {
  const auto alone = read();
  std::array<decltype(read()), 4> results;
  {
    std::vector<std::jthread> threads;
    for (auto& result : results) threads.emplace_back([&] { result = read(); });
  }
  for (const auto& result : results) EXPECT_TRUE(result == alone);
}

// A raster of bytes that covers kTile.
std::string WriteBytes(const TempDir& dir) {
  constexpr double kWidth = 180.0 / 64;
  RasterSpec spec{.width = 256, .height = 256, .type = "Byte"};
  spec.geo_transform = {kWidth, kWidth / 256, 0, kWidth, 0, -kWidth / 256};
  spec.value = [](int column, int row) { return (column * row) % 3; };
  return WriteRaster(dir, spec);
}

TEST(Threads, ReadTheTilesOfOneModel) {
  TERRACE_REQUIRE_DATA(path, "bigtujunga_30m_utm11.tif");
  const auto model = OpenOrFail(path);
  ASSERT_NE(model, nullptr);
  const std::vector<geo::TileKey> keys = SomeTiles(*model, 13, 40);
  ExpectSameOnFourThreads([&] {
    std::vector<std::vector<float>> tiles;
    for (const geo::TileKey& key : keys) tiles.push_back(model->Read(key).value().heights);
    return tiles;
  });
}

TEST(Threads, AskOneGeoid) {
  const auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
  ASSERT_TRUE(geoid);
  ExpectSameOnFourThreads([&] {
    std::vector<double> undulations;
    for (int i = 0; i < 200; ++i) undulations.push_back((*geoid)->Undulation({-70.0 + 0.01 * (i % 20), -32.6532}));
    return undulations;
  });
}

TEST(Threads, ReadOnePicture) {
  const TempDir dir;
  const auto imagery = Imagery::Open(WriteBytes(dir), {});
  ASSERT_TRUE(imagery) << imagery.error().message;
  ExpectSameOnFourThreads([&] { return (*imagery)->Read(kTile, 256).value()->rgb; });
}

TEST(Threads, ReadOneWaterMask) {
  const TempDir dir;
  const auto mask = WaterRaster::Open(WriteBytes(dir), {});
  ASSERT_TRUE(mask) << mask.error().message;
  ExpectSameOnFourThreads([&] { return (*mask)->Read(kTile).value(); });
}

TEST(Threads, OpenTheFilesOfAModel) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (int i = 0; i < 4; ++i) {
    files.push_back({WriteRaster(dir, FlatSquare(7 + i, 47, 300, 1 / 300.0, 100 * i), fmt::format("{}.tif", i))});
  }
  const auto first = OpenOrFail(files), second = OpenOrFail(files);
  ASSERT_TRUE(first != nullptr && second != nullptr);
  EXPECT_EQ(first->fingerprint(), second->fingerprint());
  for (const geo::TileKey& key : SomeTiles(*first, first->max_level(), 10)) {
    EXPECT_EQ(first->Read(key).value().heights, second->Read(key).value().heights) << geo::ToString(key);
  }
}

TEST(Threads, TakeTheStatisticsOfOneRaster) {
  const TempDir dir;
  // Of several chunks, so that each thread has one.
  const RasterSpec spec{
      .width = 2500,
      .height = 1500,
      .type = "Int16",
      .geo_transform = {7, 1 / 1200.0, 0, 47, 0, -1 / 1200.0},
      .nodata = -9999,
      .value = [](int column, int row) { return column % 97 == row % 89 ? -9999 : (7 * column + 3 * row) % 1000; }};
  const std::string path = WriteRaster(dir, spec);
  std::vector<std::unique_ptr<RasterSource>> sources;
  for (const unsigned threads : {1U, 4U}) {
    auto source = RasterSource::Open(path, {}, CacheIn(dir.File(std::to_string(threads))), {}, {}, nullptr, threads);
    ASSERT_TRUE(source) << source.error().message;
    EXPECT_GE((*source)->preparation().chunks_read, 4);
    sources.push_back(*std::move(source));
  }
  EXPECT_EQ(sources[0]->info().valid_samples, sources[1]->info().valid_samples);
  EXPECT_EQ(sources[0]->info().heights.min, sources[1]->info().heights.min);
  EXPECT_EQ(sources[0]->info().heights.max, sources[1]->info().heights.max);
  EXPECT_TRUE(sources[0]->content() == sources[1]->content());
}

}  // namespace
}  // namespace terrace::dem
