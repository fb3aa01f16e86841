// Blocks of neighbouring tiles of real elevation models: edges match vertex by vertex and errors hold, for every
// criterion.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_key.h"
#include "tests/support/test_data.h"
#include "tests/tiler/decoded_error.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

// The finest first, so that the others are replayed.
constexpr std::array kSteps = {20, 12, 6, 0};
constexpr int kSide = 3;  // tiles, of a block

struct Dem {
  const char* file;  // of the test data; null: the sample etopo5, across the antimeridian
};
constexpr Dem kDems[] = {{"srtm3_S33W071_andes.tif"},      {"srtm3_N46E008_swiss_alps.tif"},
                         {"lidar_slovenia_1m_nodata.tif"}, {"bigtujunga_30m_utm11.tif"},
                         {"webmercator_sf_float32.tif"},   {nullptr}};
std::ostream& operator<<(std::ostream& out, const Dem& dem) { return out << (dem.file ? dem.file : "etopo5"); }

// By x, then y, from the south-west.
using Block = std::array<std::array<FetchedTile, kSide>, kSide>;

class RealTiles : public testing::TestWithParam<Dem> {
 protected:
  static Dataset Open() {
    if (GetParam().file == nullptr) return OpenSample("etopo5");
    return OpenDataset("real", *test_support::TestDataPath(GetParam().file));
  }

  // The south-western tile of a block at the centre of the source.
  static geo::TileKey FirstTile(const dem::ElevationModel& model, int level) {
    if (GetParam().file == nullptr) return {level, geo::TileColumns(level) - 2, geo::TileRows(level) / 2 - 1};
    const dem::GeoBounds& bounds = model.info().bounds;
    const auto at = [level](double degrees) { return static_cast<std::int64_t>(std::ldexp(degrees / 180, level)); };
    return {level, (at(bounds.west + 180) + at(bounds.east + 180)) / 2 - 1,
            (at(bounds.south + 90) + at(bounds.north + 90)) / 2 - 1};
  }
};

// Tiles outside the source are not served, and are empty here.
std::map<int, Block> FetchBlocks(const TilePipeline& pipeline, const geo::TileKey& first) {
  std::map<int, Block> blocks;
  for (int x = 0; x < kSide; ++x) {
    for (int y = 0; y < kSide; ++y) {
      TileRequest request;
      request.key = geo::Neighbour(first, x, y);
      if (!pipeline.datasets().front().model->IsAvailable(request.key)) continue;
      for (const int step : kSteps) {
        request.error_step = step;
        blocks[step][static_cast<std::size_t>(x)][static_cast<std::size_t>(y)] = FetchTile(pipeline, request);
      }
    }
  }
  return blocks;
}

bool IsServed(const FetchedTile& tile) { return !tile.mesh.u.empty(); }

// Edges between served tiles, at most 12.
int ExpectMatchingEdges(const Block& block) {
  int edges = 0;
  const auto expect = [&](const FetchedTile& a, const FetchedTile& b, bool vertical) {
    if (!IsServed(a) || !IsServed(b)) return;
    ++edges;
    const Edge edge = EdgeOf(a, vertical, 32767);
    EXPECT_GE(edge.size(), 2u);
    EXPECT_EQ(edge, EdgeOf(b, vertical, 0));
  };
  for (std::size_t i = 0; i + 1 < kSide; ++i) {
    for (std::size_t k = 0; k < kSide; ++k) {
      expect(block[i][k], block[i + 1][k], true);
      expect(block[k][i], block[k][i + 1], false);
    }
  }
  return edges;
}

// By tile, as Block.
using BlockHeights = std::array<std::array<dem::TileHeights, kSide>, kSide>;

BlockHeights ReadHeights(const dem::ElevationModel& model, const geo::TileKey& first) {
  BlockHeights heights;
  for (int x = 0; x < kSide; ++x) {
    for (int y = 0; y < kSide; ++y) {
      const geo::TileKey key = geo::Neighbour(first, x, y);
      if (!model.IsAvailable(key)) continue;
      auto read = model.Read(key);
      EXPECT_TRUE(read.has_value()) << geo::ToString(key);
      if (read) heights[static_cast<std::size_t>(x)][static_cast<std::size_t>(y)] = *std::move(read);
    }
  }
  return heights;
}

// The stated error is at most the ladder error, and true.
void ExpectErrors(const Block& block, const BlockHeights& heights, double error_m) {
  for (std::size_t x = 0; x < kSide; ++x) {
    for (std::size_t y = 0; y < kSide; ++y) {
      const FetchedTile& tile = block[x][y];
      if (!IsServed(tile)) continue;
      EXPECT_LE(tile.encoded.max_error_m + 0x1p-11, error_m) << "heights are rounded to 2^-10 m";
      EXPECT_LE(DecodedError(tile.mesh, heights[x][y]), tile.encoded.max_error_m * (1 + 1e-9));
    }
  }
}

TEST_P(RealTiles, MatchAndKeepTheirErrorsByEveryRule) {
  if (GetParam().file != nullptr && !test_support::TestDataPath(GetParam().file)) {
    GTEST_SKIP() << test_support::MissingTestData(GetParam().file);
  }
  std::map<int, int> edges;  // by level
  for (const tin::Criterion criterion : {tin::Criterion::kDelaunay, tin::Criterion::kDataDependent}) {
    for (const bool compact : {false, true}) {
      Dataset dataset = Open();
      ASSERT_NE(dataset.model, nullptr);
      dataset.mesh_options = {criterion, compact};
      std::vector<Dataset> datasets;
      datasets.push_back(std::move(dataset));
      const TilePipeline pipeline(std::move(datasets));
      const dem::ElevationModel& model = *pipeline.datasets().front().model;
      for (const int level : {model.max_level() - 1, model.max_level()}) {
        const geo::TileKey first = FirstTile(model, level);
        const BlockHeights heights = ReadHeights(model, first);
        for (const auto& [step, block] : FetchBlocks(pipeline, first)) {
          SCOPED_TRACE(testing::Message() << "level " << level << ", step " << step << ", criterion "
                                          << static_cast<int>(criterion) << (compact ? ", compact" : ""));
          edges[level] = ExpectMatchingEdges(block);
          ExpectErrors(block, heights, geo::LadderError(level, step));
        }
      }
    }
  }
  for (const auto& [level, count] : edges) EXPECT_EQ(count, 12) << level;
}

std::string NameOf(const testing::TestParamInfo<Dem>& info) {
  std::string name;
  const std::string_view file = info.param.file ? info.param.file : "etopo5";
  for (const char c : file) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Dem, RealTiles, testing::ValuesIn(kDems), NameOf);

}  // namespace
}  // namespace terrace::tiler
