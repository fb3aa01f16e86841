// Compares Terrain-Max-Error with the true error: an independent decoder reads the bytes of the tile, and every
// sample's plumb line is intersected with every triangle. TERRACE_LONG_TESTS=1: 300 tiles of each elevation model
// instead of 4.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"
#include "tests/proto/plumb_error.h"
#include "tests/support/test_data.h"
#include "tests/tiler/decoded_error.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

// Both poles, the antimeridian, the whole Earth, 1 m, and reference systems of several kinds.
constexpr std::array kModels = {"pole_antarctica_bedmap_5km.tif",
                                "greenland_80N_100m_custom_tm.tif",
                                "etopo5_global_10min.tif",
                                "etopo1_global_1deg_float32.tif",
                                "antimeridian_hawaii_topobathy_5min.tif",
                                "srtm1_N51E179_antimeridian_w.tif",
                                "lidar_slovenia_1m_nodata.tif",
                                "bigtujunga_30m_utm11.tif",
                                "srtm3_S33W071_andes.tif",
                                "webmercator_sf_float32.tif"};

std::vector<geo::Vec3> PositionsOf(const proto::DecodedTile& mesh, const geo::TileKey& key) {
  const double side = 180.0 / static_cast<double>(std::int64_t{1} << key.level);
  const double least = static_cast<double>(mesh.min_height), most = static_cast<double>(mesh.max_height);
  std::vector<geo::Vec3> positions;
  for (std::size_t k = 0; k < mesh.u.size(); ++k) {
    positions.push_back(geo::ToEcef(side * (static_cast<double>(key.x) + mesh.u[k] / 32767.0) - 180,
                                    side * (static_cast<double>(key.y) + mesh.v[k] / 32767.0) - 90,
                                    least + (most - least) * mesh.h[k] / 32767.0));
  }
  return positions;
}

class StatedError : public testing::TestWithParam<const char*> {};

TEST_P(StatedError, IsThatOfTheBytesAlongPlumbLines) {
  const std::string file = GetParam();
  const auto path = test_support::TestDataPath(file);
  if (!path) GTEST_SKIP() << test_support::MissingTestData(file);
  std::vector<Dataset> datasets;
  datasets.push_back(OpenDataset("real", *path));
  const TilePipeline pipeline(std::move(datasets));
  const dem::ElevationModel& model = *pipeline.datasets().front().model;
  std::mt19937 random(11);
  const int count = std::getenv("TERRACE_LONG_TESTS") != nullptr ? 300 : 4;
  int above = 0, beyond = 0, as_drawn = 0;
  for (int i = 0; i < count; ++i) {
    TileRequest request;
    const int level = static_cast<int>(random() % static_cast<unsigned>(model.max_level() + 1));
    const auto& ranges = model.Available(level);
    const geo::TileRange& range = ranges[random() % ranges.size()];
    const auto within = [&](std::int64_t first, std::int64_t last) {
      return first + static_cast<std::int64_t>(random() % static_cast<unsigned>(last - first + 1));
    };
    request.key = {level, within(range.start_x, range.end_x), within(range.start_y, range.end_y)};
    request.error_step = static_cast<int>(random() % 20) - 4;
    const FetchedTile tile = FetchTile(pipeline, request);
    const auto heights = model.Read(request.key);
    ASSERT_TRUE(heights.has_value());
    const double planar = DecodedError(tile.mesh, *heights);
    const proto::FlatError drawn = proto::LargestFlatError({request.key, heights->lattice, heights->heights},
                                                           PositionsOf(tile.mesh, request.key), tile.mesh.triangles);
    const double stated = tile.encoded.max_error_m;
    const double least = std::max(planar, drawn.least) - 1e-5, most = std::max(planar, drawn.most) * 1.001 + 0.001;
    EXPECT_GE(stated, least) << file << ' ' << geo::ToString(request.key);
    EXPECT_LE(stated, most) << file << ' ' << geo::ToString(request.key);
    if (stated < least) ++above;
    if (stated > most) ++beyond;
    if (drawn.most > planar) ++as_drawn;
  }
  std::printf("%-40s %d tiles, %d above what is stated, %d more than 1.001 of it below, %d worse as drawn\n",
              file.c_str(), count, above, beyond, as_drawn);
  RecordProperty("tiles", count);
  RecordProperty("above", above);
}

std::string NameOf(const testing::TestParamInfo<const char*>& model) {
  const std::string file = model.param;
  return file.substr(0, file.find('.'));
}

INSTANTIATE_TEST_SUITE_P(Models, StatedError, testing::ValuesIn(kModels), NameOf);

}  // namespace
}  // namespace terrace::tiler
