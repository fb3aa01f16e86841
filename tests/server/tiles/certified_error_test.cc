// The certified error against the truth: every sample of the full-resolution source, found and placed by GDAL alone,
// against the triangles that an independent decoder finds in the bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"
#include "server/tiles/tile_pipeline.h"
#include "tests/server/tiles/fetched_tile.h"
#include "tests/server/tiles/tile_surface.h"
#include "tests/support/test_data.h"

namespace terrace::server {
namespace {

constexpr std::array kFiles = {"srtm3_N46E008_swiss_alps.tif", "bigtujunga_30m_utm11.tif",
                               "lidar_slovenia_1m_nodata.tif", "pole_antarctica_bedmap_5km.tif",
                               "etopo5_global_10min.tif",      "webmercator_sf_float32.tif"};

TEST(CertifiedError, IsNeverBelowTheTruthAndNotMuchAboveIt) {
  std::vector<double> ratios;
  for (const char* file : kFiles) {
    const auto path = test_support::TestDataPath(file);
    if (!path) GTEST_SKIP() << test_support::MissingTestData(file);
    const std::vector<Sample> samples = SamplesOf(*path);
    std::vector<Dataset> datasets;
    datasets.push_back(OpenDataset("real", *path));
    const TilePipeline pipeline(std::move(datasets));
    const dem::DemSource& source = *pipeline.datasets().front().source;
    std::mt19937 random(7);
    std::vector<double> here;
    for (int i = 0; i < 40; ++i) {
      TileRequest request;
      const int level = static_cast<int>(random() % static_cast<unsigned>(source.max_level() + 1));
      const auto& ranges = source.Available(level);
      const geo::TileRange& range = ranges[random() % ranges.size()];
      const auto within = [&](std::int64_t first, std::int64_t last) {
        return first + static_cast<std::int64_t>(random() % static_cast<unsigned>(last - first + 1));
      };
      request.key = {level, within(range.start_x, range.end_x), within(range.start_y, range.end_y)};
      request.error_step = static_cast<int>(random() % 25) - 8;
      const FetchedTile tile = FetchTile(pipeline, request);
      ASSERT_TRUE(tile.encoded.certified_error_m.has_value());
      const TileSurface surface(tile.mesh, request.key);
      const double truth = surface.LargestError(samples);
      const double certified = *tile.encoded.certified_error_m;
      if (truth < 0) continue;  // no sample lies here
      EXPECT_GE(certified, truth) << file << " " << geo::ToString(request.key) << " step " << request.error_step;
      EXPECT_GE(certified, tile.encoded.max_error_m);
      if (truth > 0) here.push_back(certified / truth);
      if (std::getenv("TERRACE_PRINT_TILES") != nullptr) {
        std::printf("  %s step %d: max %.4g, surface %.4g, certified %.4g, true %.4g, ratio %.3f\n",
                    geo::ToString(request.key).c_str(), request.error_step, tile.encoded.max_error_m, 0.0, certified,
                    truth, certified / truth);
      }
    }
    std::ranges::sort(here);
    ASSERT_FALSE(here.empty()) << file;
    std::printf("%-34s %zu tiles, certified / true error: median %.2f, 90 %% %.2f, largest %.2f\n", file, here.size(),
                here[here.size() / 2], here[here.size() * 9 / 10], here.back());
    EXPECT_LE(here[here.size() / 2], 3) << file;
    ratios.insert(ratios.end(), here.begin(), here.end());
  }
  std::ranges::sort(ratios);
  std::printf("all: %zu tiles, median %.2f\n", ratios.size(), ratios[ratios.size() / 2]);
  EXPECT_GE(ratios.size(), 200u);
}

}  // namespace
}  // namespace terrace::server
