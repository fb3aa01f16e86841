#include "proto/error/tile_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/tin/sample_inserter.h"
#include "proto/mesh/grid_mesh.h"
#include "proto/mesh/quantize_tile.h"
#include "proto/mesh/tile_geometry.h"
#include "tests/proto/ground.h"
#include "tests/proto/plumb_error.h"

namespace terrace::proto {
namespace {

EdgeSteps FineSteps() { return {{0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}, {0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}}; }

// Measures every node against every triangle, by signs of areas.
double LargestError(const TileSamples& samples, const QuantizedTile& tile) {
  const std::int64_t cells = samples.cells();
  double largest = 0;
  for (const auto& t : tile.triangles) {
    std::array<std::int64_t, 3> x{}, y{};
    std::array<double, 3> z{};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = tile.u[t[k]] * cells, y[k] = tile.v[t[k]] * cells;
      z[k] =
          static_cast<double>(tile.min_height) +
          (static_cast<double>(tile.max_height) - static_cast<double>(tile.min_height)) * tile.h[t[k]] / kQuantizedMax;
    }
    for (std::int64_t j = 0; j <= cells; ++j) {
      for (std::int64_t i = 0; i <= cells; ++i) {
        std::array<std::int64_t, 3> area{};
        bool inside = true;
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
          area[k] = (x[b] - x[a]) * (j * kQuantizedMax - y[a]) - (y[b] - y[a]) * (i * kQuantizedMax - x[a]);
          inside &= area[k] >= 0;
        }
        if (!inside) continue;
        const double surface = (static_cast<double>(area[0]) * z[0] + static_cast<double>(area[1]) * z[1] +
                                static_cast<double>(area[2]) * z[2]) /
                               static_cast<double>(area[0] + area[1] + area[2]);
        const double sample = samples.At(static_cast<int>(i), static_cast<int>(j));
        largest = std::max(largest, std::abs(surface - sample));
      }
    }
  }
  return largest;
}

TEST(TileError, ListsForEachTriangleASampleThatMissesTheBound) {
  const RandomGround ground({9, 300, 400}, 64, 256, 9);
  const QuantizedTile tile = QuantizeTile(ground.view(), GreedyMesh(ground.view(), {.max_error = 120}), FineSteps());
  const TileError error = TileErrorMeter(ground.view(), 60).Measure(tile);
  ASSERT_FALSE(error.to_insert.empty());
  EXPECT_LE(error.to_insert.size(), tile.triangles.size());
  for (const tin::SamplePosition sample : error.to_insert) {
    EXPECT_TRUE(sample.x > 0 && sample.y > 0 && sample.x < 64 && sample.y < 64);
  }
}

// Rounded positions are not nodes, so slivers are between rows, and edges pass very close to nodes.
TEST(TileError, FindsTheLargestErrorThatAnySampleHas) {
  for (const int cells : {32, 64}) {
    // The reference searches every triangle for every sample, which is slow under sanitizers, so there are few large
    // tiles.
    for (unsigned seed = 0; seed < 6; seed += cells == 32 ? 1 : 5) {
      const RandomGround ground({9, 300, 400}, cells, 256, seed);
      const QuantizedTile tile =
          QuantizeTile(ground.view(), GreedyMesh(ground.view(), {.max_error = 40.0 + 20 * seed}), FineSteps());
      const TileError error = TileErrorMeter(ground.view(), 1e9).Measure(tile);
      const double planar = LargestError(ground.view(), tile);
      const FlatError drawn = LargestFlatError(ground.view(), DecodePositions(tile), tile.triangles);
      EXPECT_GE(error.max_m, std::max(planar, drawn.least) - 1e-6) << cells << ' ' << seed;
      EXPECT_LE(error.max_m, std::max(planar, drawn.most) + 1e-3) << cells << ' ' << seed;
      EXPECT_TRUE(error.to_insert.empty());
    }
  }
}

// From a street to a sixth of the Earth, at both poles, at the antimeridian and in between.
TEST(TileError, IsThatOfThePlumbLinesOfAllSamples) {
  for (const int level : {2, 4, 6, 8, 12, 15}) {
    const std::int64_t rows = geo::TileRows(level), columns = geo::TileColumns(level);
    for (const std::int64_t row : {std::int64_t{0}, rows / 6, rows / 2, rows * 3 / 4, rows - 1}) {
      const RandomGround ground({level, row % 2 == 0 ? columns / 3 : columns - 1, row}, 32, 40000.0 / (1 << level), 5);
      const tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_points = 300});
      const QuantizedTile tile = QuantizeTile(ground.view(), mesh, FineSteps());
      const double planar = LargestError(ground.view(), tile);
      const FlatError drawn = LargestFlatError(ground.view(), DecodePositions(tile), tile.triangles);
      const double stated = TileErrorMeter(ground.view(), 1e9).Measure(tile).max_m;
      EXPECT_GE(stated, std::max(planar, drawn.least) - 1e-6) << level << ' ' << row;
      EXPECT_LE(stated, std::max(planar, drawn.most) * 1.001 + 0.001) << level << ' ' << row;

      std::vector<geo::Vec3> positions;
      for (const tin::SamplePosition p : mesh.vertices) {
        positions.push_back(
            geo::ToEcef(ground.view().Longitude(p.x), ground.view().Latitude(p.y), ground.view().At(p.x, p.y)));
      }
      const FlatError flat = LargestFlatError(ground.view(), positions, mesh.triangles);
      const double stated_flat = TileErrorMeter(ground.view(), 1e9).MeasureFlat(mesh, positions).max_m;
      EXPECT_GE(stated_flat, flat.least - 1e-6) << level << ' ' << row;
      EXPECT_LE(stated_flat, flat.most * 1.001 + 0.001) << level << ' ' << row;
    }
  }
}

void ExpectEqual(const TileError& a, const TileError& b) {
  EXPECT_EQ(a.max_m, b.max_m);
  ASSERT_EQ(a.to_insert.size(), b.to_insert.size());
  for (std::size_t i = 0; i < a.to_insert.size(); ++i) {
    EXPECT_TRUE(a.to_insert[i].x == b.to_insert[i].x && a.to_insert[i].y == b.to_insert[i].y) << i;
  }
}

// Several rounds: in some of them an inserted sample changes the tile's lowest or highest vertex, and so all heights.
// Then other heights, a mesh of other triangles, and the same mesh twice.
TEST(TileErrorMeter, MeasuresAsIfItWereTheFirstTime) {
  const RandomGround ground({9, 300, 400}, 64, 256, 9);
  TileErrorMeter meter(ground.view(), 60);
  tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_error = 150});
  QuantizedTile tile;
  int rounds = 0;
  for (bool to_insert = true; to_insert; ++rounds) {
    ASSERT_LT(rounds, 100);
    tile = QuantizeTile(ground.view(), mesh, FineSteps());
    const TileError error = meter.Measure(tile);
    ExpectEqual(error, TileErrorMeter(ground.view(), 60).Measure(tile));
    to_insert = !error.to_insert.empty();
    if (to_insert) mesh = tin::InsertSamples(mesh, {error.to_insert.data(), 1 + error.to_insert.size() / 3});
  }
  EXPECT_GT(rounds, 5);
  const QuantizedTile other = QuantizeTile(ground.view(), GreedyMesh(ground.view(), {.max_error = 100}), FineSteps());
  // Other vertices, and the same ones at other heights.
  QuantizedTile lifted = tile;
  lifted.min_height += 64;
  lifted.max_height += 64;
  for (const QuantizedTile& next : {tile, other, other, tile, lifted, tile}) {
    ExpectEqual(meter.Measure(next), TileErrorMeter(ground.view(), 60).Measure(next));
  }
}

TEST(TileErrorMeter, MeasuresFlatTrianglesAsIfItWereTheFirstTime) {
  const RandomGround ground({9, 300, 400}, 64, 256, 4);
  TileErrorMeter meter(ground.view(), 60);
  tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_error = 150});
  std::size_t to_insert = 1;
  for (const double step : {1.0 / 16, 1.0 / 16, 1.0 / 16, 1.0 / 16, 8.0, 8.0, 1.0 / 64}) {
    const std::vector<geo::Vec3> positions = GridPositions(SnapVertices(ground.view(), mesh, step), step);
    const TileError error = meter.MeasureFlat(mesh, positions);
    ExpectEqual(error, TileErrorMeter(ground.view(), 60).MeasureFlat(mesh, positions));
    to_insert = error.to_insert.size();
    mesh = tin::InsertSamples(mesh, {error.to_insert.data(), to_insert / 3});
  }
  EXPECT_GT(to_insert, 0u) << "nothing was left to be told again";
}

}  // namespace
}  // namespace terrace::proto
