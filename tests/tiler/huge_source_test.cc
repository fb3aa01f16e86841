// A source of 100,000 x 100,000 samples without overviews is prepared in bounded memory, also with interruptions.
// Afterwards any tile of any level reads few bytes. The test prints times but does not check them.
#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "engine/statistics/cache_folder.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

constexpr int kSide = 100'000, kPatch = 1024;

bool IsLong() { return std::getenv("TERRACE_LONG_TESTS") != nullptr; }

// A deflated, tiled and sparse file: distant patches of terrain with voids between them.
void WriteSource(const std::string& path) {
  GDALAllRegister();
  const char* const options[] = {"TILED=YES", "SPARSE_OK=TRUE", "COMPRESS=DEFLATE", "ZLEVEL=1", "BIGTIFF=YES", nullptr};
  GDALDatasetUniquePtr dataset(GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
      path.c_str(), kSide, kSide, 1, GDT_Int16, const_cast<char**>(options)));
  std::array<double, 6> transform = {0, 1 / 3600.0, 0, 47, 0, -1 / 3600.0};
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference srs;
  srs.SetFromUserInput("EPSG:4326");
  dataset->SetSpatialRef(&srs);
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  band.SetNoDataValue(-32768);
  std::vector<std::int16_t> patch(static_cast<std::size_t>(kPatch) * kPatch);
  const int step = IsLong() ? 2 * kPatch : 20 * kPatch;
  for (int top = 0; top + kPatch <= kSide; top += step) {
    for (int left = 0; left + kPatch <= kSide; left += step) {
      for (int r = 0; r < kPatch; ++r) {
        for (int c = 0; c < kPatch; ++c) {
          patch[static_cast<std::size_t>(r * kPatch + c)] =
              static_cast<std::int16_t>(1500 + 900 * std::sin((left + c) * .004) * std::cos((top + r) * .0031) +
                                        20 * std::sin(c * .31 + r * .27));
        }
      }
      ASSERT_EQ(
          band.RasterIO(GF_Write, left, top, kPatch, kPatch, patch.data(), kPatch, kPatch, GDT_Int16, 0, 0, nullptr),
          CE_None);
    }
  }
}

long FieldOf(const char* file, const std::string& name) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(name)) return std::atol(line.c_str() + name.size());
  }
  return 0;
}
double PeakMegabytes() { return static_cast<double>(FieldOf("/proc/self/status", "VmHWM:")) / 1024; }
double MegabytesRead() { return static_cast<double>(FieldOf("/proc/self/io", "rchar:")) / (1 << 20); }

double Since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::unique_ptr<dem::ElevationModel> Open(const std::string& path, const std::string& cache,
                                          const std::function<void(double)>& progress = {}) {
  dem::DemOptions options;
  options.cache.folder = std::make_shared<dem::CacheFolder>(cache);
  options.progress = progress;
  auto source = dem::ElevationModel::Open(path, options);
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

TEST(HugeSource, IsPreparedOnceAndServedFromFewBytes) {
  const std::filesystem::path dir =
      std::filesystem::temp_directory_path() / ("terrace_huge_" + std::to_string(::getpid()));
  std::filesystem::create_directories(dir);
  const std::string path = (dir / "huge.tif").string(), cache = (dir / "cache").string();
  // Work in child processes does not count in this process's memory.
  const auto in_child = [](const auto& work) {
    const pid_t child = ::fork();
    if (child == 0) {
      work();
      ::_exit(testing::Test::HasFailure() ? 1 : 0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return status;
  };
  ASSERT_EQ(in_child([&] { WriteSource(path); }), 0);

  const int killed = in_child([&] {
    Open(path, cache, [](double share) {
      if (share > .4) ::raise(SIGKILL);
    });
  });
  ASSERT_TRUE(WIFSIGNALED(killed));

  int calls = 0;
  double first_share = 1, last_share = 0;
  auto start = std::chrono::steady_clock::now();
  const auto prepared = Open(path, cache, [&](double share) {
    ++calls;
    first_share = std::min(first_share, share);
    EXPECT_GE(share, last_share);
    last_share = share;
  });
  ASSERT_NE(prepared, nullptr);
  std::printf("prepared from %.0f %% on in %.2f s, peak memory %.0f MB\n", first_share * 100, Since(start),
              PeakMegabytes());
  EXPECT_GT(first_share, .39) << "it goes on where it was killed";
  EXPECT_EQ(last_share, 1);
  EXPECT_GT(calls, 1000);
  EXPECT_LT(PeakMegabytes(), 512);

  start = std::chrono::steady_clock::now();
  double before = MegabytesRead();
  std::vector<Dataset> datasets(1);
  datasets[0].name = "huge";
  datasets[0].model = Open(path, cache, [](double share) { EXPECT_EQ(share, 1) << "nothing is left to do"; });
  ASSERT_NE(datasets[0].model, nullptr);
  std::printf("second start: %.2f s, %.0f MB read\n", Since(start), MegabytesRead() - before);
  EXPECT_LT(MegabytesRead() - before, 200);

  const TilePipeline pipeline(std::move(datasets));
  const dem::ElevationModel& model = *pipeline.datasets()[0].model;
  std::mt19937 random(5);
  double slowest = 0, most_read = 0;
  for (int level = 0; level <= model.max_level(); ++level) {
    double slowest_here = 0, read_here = 0;
    std::uint32_t vertices = 0;
    for (int i = 0; i < 6; ++i) {
      TileRequest request;
      const geo::TileRange& range = model.Available(level)[0];
      request.key = {level, range.start_x + static_cast<std::int64_t>(random()) % (range.end_x - range.start_x + 1),
                     range.start_y + static_cast<std::int64_t>(random()) % (range.end_y - range.start_y + 1)};
      // Half of the tiles are in the corner with the first patch.
      if (i % 2 == 0) request.key = {level, range.start_x, range.end_y};
      request.error_step = 4 * i - 8;
      before = MegabytesRead();
      start = std::chrono::steady_clock::now();
      const auto tile = pipeline.Build(request, {});
      ASSERT_TRUE(tile.has_value()) << tile.error().message;
      slowest_here = std::max(slowest_here, Since(start));
      read_here = std::max(read_here, MegabytesRead() - before);
      vertices = std::max(vertices, tile->vertices);
      EXPECT_TRUE(tile->certified_error_m && *tile->certified_error_m >= tile->max_error_m);
    }
    std::printf("level %2d: slowest %.0f ms, most read %.1f MB, most vertices %u\n", level, slowest_here * 1000,
                read_here, vertices);
    slowest = std::max(slowest, slowest_here);
    most_read = std::max(most_read, read_here);
  }
  std::printf(
      "slowest tile %.0f ms, most read %.1f MB, peak memory %.0f MB, record %.0f MB\n", slowest * 1000, most_read,
      PeakMegabytes(),
      static_cast<double>(std::filesystem::file_size(std::filesystem::directory_iterator(cache)->path())) / (1 << 20));
  EXPECT_LT(most_read, 32);
  EXPECT_LT(PeakMegabytes(), 512);
  std::filesystem::remove_all(dir);
}

}  // namespace
}  // namespace terrace::tiler
