// Compares the certified error with the true error: every full-resolution sample of the sources, along its plumb line,
// against the triangles that an independent decoder finds in the bytes. TERRACE_LONG_TESTS=1: 10,000 tiles and more
// instead of hundreds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "tests/tiler/certified_sources.h"
#include "tests/tiler/fetched_tile.h"
#include "tests/tiler/tile_surface.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

bool IsLong() { return std::getenv("TERRACE_LONG_TESTS") != nullptr; }

// Totals of all datasets that this process tested.
struct All {
  int tiles = 0, above = 0;
  std::vector<double> ratios;
};
All& Tried() {
  static All all;
  return all;
}

double MedianOf(std::vector<double> ratios) {
  std::ranges::sort(ratios);
  return ratios[ratios.size() / 2];
}

class CertifiedError : public testing::TestWithParam<CertifiedCase> {
 protected:
  static void TearDownTestSuite() {
    const All& all = Tried();
    if (all.ratios.empty()) return;
    std::printf("all: %d tiles, %d above their certified error, certified / true error: median %.2f\n", all.tiles,
                all.above, MedianOf(all.ratios));
  }
};

std::optional<TilePipeline> Open(const CertifiedSource& source) {
  auto opened = dem::ElevationModel::Open(source.files, source.options);
  EXPECT_TRUE(opened.has_value()) << (opened ? "" : opened.error().message);
  if (!opened) return std::nullopt;
  Dataset dataset;
  dataset.name = "tried";
  dataset.model = *std::move(opened);
  dataset.generation = dataset.model->fingerprint();
  dataset.mesh_options = source.mesh_options;
  std::vector<Dataset> datasets;
  datasets.push_back(std::move(dataset));
  return std::optional<TilePipeline>(std::in_place, std::move(datasets));
}

// Tiles around random samples, the same number for all levels except those whose tiles have too many samples.
class RandomTiles {
 public:
  RandomTiles(const dem::ElevationModel& model, const SampleIndex& samples)
      : model_(model), samples_(samples), tries_(static_cast<std::size_t>(model.max_level() + 1)) {}

  // A tile of the next level that needs more tiles. `deep_and_fine`: of the two deepest levels, with the smallest
  // error.
  TileRequest Next(bool deep_and_fine) {
    TileRequest request;
    do {
      const std::size_t levels = deep_and_fine ? std::min<std::size_t>(tries_.size(), 2) : tries_.size();
      const int level = static_cast<int>(tries_.size() - 1 - turn_++ % levels);
      const Sample& at = samples_.all()[random_() % samples_.all().size()];
      const double side = 180.0 / static_cast<double>(geo::TileRows(level));
      const auto tile = [side](double from, std::int64_t count) {
        return std::clamp(static_cast<std::int64_t>(std::floor(from / side)), std::int64_t{0}, count - 1);
      };
      request.key = {level, tile(at.longitude + 180, 2 * geo::TileRows(level)),
                     tile(at.latitude + 90, geo::TileRows(level))};
    } while (!model_.IsAvailable(request.key) || !IsWanted(request.key));
    request.error_step = deep_and_fine ? geo::kFinestStep : static_cast<int>(random_() % 25) - 8;
    return request;
  }

 private:
  bool IsWanted(const geo::TileKey& key) {
    constexpr int kManySamples = 100'000, kOfMany = 2;  // at most two tiles of a level whose samples take seconds
    int& tries = tries_[static_cast<std::size_t>(key.level)];
    if (tries < kOfMany) return ++tries > 0;
    const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
    const double west = side * static_cast<double>(key.x) - 180, south = side * static_cast<double>(key.y) - 90;
    int count = 0;
    samples_.ForEach(west, south, west + side, south + side, [&](const Sample&) { ++count; });
    return count <= kManySamples;
  }

  const dem::ElevationModel& model_;
  const SampleIndex& samples_;
  std::vector<int> tries_;  // by level
  std::size_t turn_ = 0;
  std::mt19937 random_{7};
};

TEST_P(CertifiedError, IsNeverBelowTheTruthAndNotMuchAboveIt) {
  const CertifiedCase& tried = GetParam();
  const dem::TempDir dir;
  std::string missing;
  auto source = tried.make(dir, missing);
  if (!source) GTEST_SKIP() << missing;
  const auto pipeline = Open(*source);
  ASSERT_TRUE(pipeline.has_value());
  const SampleIndex samples(std::move(source->samples));
  RandomTiles random(*pipeline->datasets().front().model, samples);
  const int tiles = IsLong() ? 240 : 16;
  int above = 0;
  std::vector<double> ratios;
  for (int i = 0; i < tiles; ++i) {
    const TileRequest request = random.Next(tried.deep_and_fine && i % 2 == 0);
    const FetchedTile tile = FetchTile(*pipeline, request);
    ASSERT_TRUE(tile.encoded.certified_error_m.has_value());
    const double truth = TileSurface(tile.mesh, request.key).LargestError(samples);
    const double certified = *tile.encoded.certified_error_m;
    if (certified < truth) ++above;
    EXPECT_GE(certified, truth) << tried.name << ' ' << geo::ToString(request.key) << " step " << request.error_step;
    EXPECT_GE(certified, tile.encoded.max_error_m) << tried.name << ' ' << geo::ToString(request.key);
    if (truth > 0) ratios.push_back(certified / truth);
    if (std::getenv("TERRACE_PRINT_TILES") != nullptr) {
      std::printf("  %s step %d: max %.4g, certified %.4g, true %.4g, ratio %.3f\n", geo::ToString(request.key).c_str(),
                  request.error_step, tile.encoded.max_error_m, certified, truth, certified / truth);
    }
  }
  ASSERT_GE(ratios.size(), static_cast<std::size_t>(tiles) / 2);
  std::ranges::sort(ratios);
  const double median = ratios[ratios.size() / 2];
  std::printf("%-42s %d tiles, %d above, certified / true error: median %.2f, 90 %% %.2f, largest %.2f\n",
              tried.name.c_str(), tiles, above, median, ratios[ratios.size() * 9 / 10], ratios.back());
  EXPECT_LE(median, tried.most_in_median);
  RecordProperty("tiles", tiles);
  RecordProperty("above", above);
  RecordProperty("hundredths_in_median", static_cast<int>(std::lround(100 * median)));
  Tried().tiles += tiles;
  Tried().above += above;
  Tried().ratios.insert(Tried().ratios.end(), ratios.begin(), ratios.end());
}

// Flat triangles are farthest from the Earth between samples and edges, and these tiles have nothing else.
TEST(CertifiedErrorOfAFlatWorld, HoldsInsideOfTriangles) {
  const dem::TempDir dir;
  CertifiedSource source = FlatWorld(dir);
  const auto pipeline = Open(source);
  ASSERT_TRUE(pipeline.has_value());
  const SampleIndex samples(std::move(source.samples));
  TileRequest request;
  for (std::int64_t y = 3; y < 8; ++y) {
    for (std::int64_t x = 0; x < 16; ++x) {
      request.key = {3, x, y};
      const FetchedTile tile = FetchTile(*pipeline, request);
      EXPECT_GE(tile.encoded.certified_error_m, TileSurface(tile.mesh, request.key).LargestError(samples))
          << geo::ToString(request.key);
    }
  }
}

std::string NameOf(const testing::TestParamInfo<CertifiedCase>& tried) {
  std::string name;
  for (const char letter : tried.param.name) name += std::isalnum(static_cast<unsigned char>(letter)) ? letter : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Real, CertifiedError, testing::ValuesIn(RealCases()), NameOf);
INSTANTIATE_TEST_SUITE_P(Written, CertifiedError, testing::ValuesIn(WrittenCases()), NameOf);
INSTANTIATE_TEST_SUITE_P(NearlyAligned, CertifiedError, testing::ValuesIn(NearlyAlignedCases()), NameOf);

}  // namespace
}  // namespace terrace::tiler
