// Measures decoded tiles of a cliff that is far higher than their error, for every criterion and format. Positions are
// rounded, and a vertex that is moved along the cliff has a wrong height at its own sample.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/proto/glb_decoder.h"
#include "tests/proto/plumb_error.h"
#include "tests/tiler/decoded_error.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

constexpr double kCliff_m = 8000;
constexpr double kPixel = 180.0 / 4096 / 256 * 5;  // degrees; the deepest level is 13

// A winding cliff between two rough plains.
std::string WriteCliff(const dem::TempDir& dir) {
  dem::RasterSpec spec{.width = 420, .height = 420};
  spec.geo_transform = {10, kPixel, 0, 45, 0, -kPixel};
  spec.value = [](int x, int y) {
    const double rough = (x * 37 + y * 91 + x * y % 17) % 211 * 0.03,
                 rim = 210 + 0.37 * (x - 210) + 30 * std::sin(x / 17.0);
    return (y > rim ? kCliff_m : 0) + rough + 20 * std::sin(x / 40.0) * std::cos(y / 31.0);
  };
  return dem::WriteRaster(dir, spec);
}

TilePipeline MakePipeline(const std::string& path, tin::Criterion criterion, bool compact) {
  std::vector<Dataset> datasets;
  datasets.push_back(OpenDataset("cliff", path));
  datasets.back().mesh_options = {criterion, compact};
  return TilePipeline(std::move(datasets));
}

// The largest error of a sample in metres if vertices are `columns` and `rows` cells away from their samples and
// triangles are no steeper than the ground between the samples around it.
double LossAt(const dem::TileHeights& heights, int i, int j, double columns, double rows) {
  const int cells = heights.lattice.cells;
  double east = 0, north = 0;
  for (int y = std::max(j - 1, 0); y <= std::min(j + 1, cells); ++y) {
    for (int x = std::max(i - 1, 0); x <= std::min(i + 1, cells); ++x) {
      const auto from = static_cast<double>(heights.At(x, y));
      if (x <= std::min(i, cells - 1)) east = std::max(east, std::abs(heights.At(x + 1, y) - from));
      if (y <= std::min(j, cells - 1)) north = std::max(north, std::abs(heights.At(x, y + 1) - from));
    }
  }
  return east * columns + north * rows;
}

double LargestLoss(const dem::TileHeights& heights, double columns, double rows) {
  double largest = 0;
  for (int j = 0; j <= heights.lattice.cells; ++j) {
    for (int i = 0; i <= heights.lattice.cells; ++i) largest = std::max(largest, LossAt(heights, i, j, columns, rows));
  }
  return largest;
}

// Calls visit(pipeline, request, heights) for every criterion, two errors, and the tiles of two levels that the cliff
// crosses.
template <typename Visit>
void ForEachTile(const Visit& visit) {
  const dem::TempDir dir;
  const std::string path = WriteCliff(dir);
  for (const tin::Criterion criterion : {tin::Criterion::kDelaunay, tin::Criterion::kDataDependent}) {
    for (const bool compact : {false, true}) {
      const TilePipeline pipeline = MakePipeline(path, criterion, compact);
      const dem::ElevationModel& model = *pipeline.datasets().front().model;
      for (const int level : {model.max_level() - 2, model.max_level() - 1}) {
        for (const geo::TileKey& key : dem::SomeTiles(model, level, 1000)) {
          const auto heights = model.Read(key);
          ASSERT_TRUE(heights.has_value());
          if (LargestLoss(*heights, 1, 1) < kCliff_m / 2) continue;
          for (const int step : {0, 8}) {
            SCOPED_TRACE(testing::Message() << geo::ToString(key) << " step " << step << " criterion "
                                            << static_cast<int>(criterion) << (compact ? " compact" : ""));
            TileRequest request;
            request.key = key;
            request.error_step = step;
            visit(pipeline, request, *heights);
          }
        }
      }
    }
  }
}

TEST(Cliffs, CostNoMoreThanTheRoundingOfPositions) {
  constexpr double kHeightStep_m = kCliff_m / 16384;  // the coarsest step of edges; rounding takes half of it
  int tiles = 0, above = 0;
  ForEachTile([&](const TilePipeline& pipeline, const TileRequest& request, const dem::TileHeights& heights) {
    const int cells = heights.lattice.cells;
    const double asked_m = geo::LadderError(request.key.level, request.error_step), rounding = cells / 65534.0;
    const FetchedTile tile = FetchTile(pipeline, request);
    const std::vector<double> errors = DecodedErrors(tile.mesh, heights);
    for (int j = 0; j <= cells; ++j) {
      for (int i = 0; i <= cells; ++i) {
        const double error = errors[static_cast<std::size_t>(j * (cells + 1) + i)];
        if (error <= asked_m) continue;
        ++above;
        EXPECT_LE(error, LossAt(heights, i, j, rounding, rounding) + kHeightStep_m) << i << ' ' << j;
      }
    }
    EXPECT_LE(tile.encoded.max_error_m, std::max(asked_m, LargestLoss(heights, rounding, rounding) + kHeightStep_m));
    EXPECT_GE(tile.encoded.max_error_m * (1 + 1e-9), std::ranges::max(errors));
    ++tiles;
  });
  EXPECT_GT(tiles, 200);
  EXPECT_GT(above, 100) << "nothing that only finer positions could mend: too low a cliff";
}

// The step of Draco's grid is a 128th of a metre, that of 16 bits a 32nd of the error. On an edge it adds to the error
// of the edge's simplification.
TEST(Cliffs, CostGlbTilesNoMoreThanTheirGrid) {
  int tiles = 0;
  ForEachTile([&](const TilePipeline& pipeline, TileRequest request, const dem::TileHeights& heights) {
    request.format = TileFormat::kGlb;
    const double asked_m = geo::LadderError(request.key.level, request.error_step);
    const double cell_m = geo::kSemiMajorAxis * geo::ToRadians(heights.lattice.StepDegrees());
    for (const proto::GlbCompression compression : {proto::GlbCompression::kDraco, proto::GlbCompression::kMeshopt}) {
      request.compression = compression;
      const double grid_m = compression == proto::GlbCompression::kDraco ? 0x1p-7 : std::min(asked_m / 32, cell_m / 64);
      const double rows = std::sqrt(0.75) * grid_m / cell_m, columns = rows / std::cos(geo::ToRadians(45));
      const auto encoded = pipeline.Build(request, {});
      ASSERT_TRUE(encoded.has_value());
      EXPECT_LE(encoded->max_error_m, asked_m + LargestLoss(heights, columns, rows)) << static_cast<int>(compression);
      ++tiles;
      if (tiles % 16 != 0) continue;
      const auto glb = proto::DecodeGlb(encoded->bytes);
      ASSERT_TRUE(glb.has_value());
      const proto::TileSamples samples{request.key, heights.lattice, heights.heights};
      // Leaves out the rim, which has skirts.
      EXPECT_LE(proto::LargestFlatError(samples, glb->positions, glb->triangles, 1).least,
                encoded->max_error_m * 1.0001 + 0.001);
    }
  });
  EXPECT_GT(tiles, 400);
}

}  // namespace
}  // namespace terrace::tiler
