#include "proto/mesh/quantize_tile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/greedy.h"
#include "proto/error/tile_error.h"

namespace terrace::proto {
namespace {

// A lattice with given heights.
struct Ground {
  geo::TileKey key;
  geo::Lattice lattice;
  std::vector<float> heights;

  Ground(geo::TileKey tile, int cells, const std::function<double(int, int)>& height)
      : key(tile), lattice{tile.level, cells} {
    for (int j = -1; j <= cells + 1; ++j) {
      for (int i = -1; i <= cells + 1; ++i)
        heights.push_back(static_cast<float>(std::floor(height(i, j) * 1024) / 1024));
    }
  }
  TileSamples view() const { return {key, lattice, heights}; }
};

tin::TinMesh TwoTriangles(int cells) {
  const auto side = static_cast<std::uint16_t>(cells);
  return {{{0, 0}, {side, 0}, {side, side}, {0, side}}, {{0, 1, 2}, {0, 2, 3}}};
}

tin::TinMesh EverySample(int cells) {
  tin::TinMesh mesh;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i)
      mesh.vertices.push_back({static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j)});
  }
  const auto side = static_cast<std::uint32_t>(cells) + 1;
  for (std::uint32_t j = 0; j + 1 < side; ++j) {
    for (std::uint32_t i = 0; i + 1 < side; ++i) {
      const std::uint32_t a = j * side + i;
      mesh.triangles.push_back({a, a + 1, a + side + 1});
      mesh.triangles.push_back({a, a + side + 1, a + side});
    }
  }
  return mesh;
}

EdgeSteps AllSteps(double step) { return {{step, step, step, step}, {step, step, step, step}}; }

double Decode(const QuantizedTile& tile, std::size_t vertex) {
  const double min = static_cast<double>(tile.min_height), max = static_cast<double>(tile.max_height);
  return min + (max - min) * tile.h[vertex] / kQuantizedMax;
}

TEST(QuantizedPosition, IsTheContractsFormula) {
  for (const int cells : {32, 64, 128, 256}) {
    for (int i = 0; i <= cells; ++i) {
      EXPECT_EQ(QuantizedPosition(i, cells), std::floor(i * 32767.0 / cells + 0.5)) << i << " of " << cells;
    }
  }
}

TEST(QuantizeTile, DecodesEdgeHeightsExactlyWhateverTheInside) {
  std::mt19937 random(3);
  for (int run = 0; run < 200; ++run) {
    const double relief = std::exp2(std::uniform_real_distribution<double>(0, 12)(random));
    const double base = std::uniform_real_distribution<double>(-500, 4000)(random);
    std::uniform_real_distribution<double> inside(base - relief, base + relief),
        edge(base - relief / 50, base + relief / 50);
    const Ground ground({11, 1080, 1440}, 32, [&](int i, int j) {
      return i <= 0 || j <= 0 || i >= 32 || j >= 32 ? edge(random) : inside(random);
    });
    const double step = NeededStep(base - relief, base + relief);
    const tin::TinMesh mesh = EverySample(32);
    const QuantizedTile tile = QuantizeTile(ground.view(), mesh, AllSteps(step));
    for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
      const auto [x, y] = mesh.vertices[k];
      const double sample = static_cast<double>(ground.view().At(x, y));
      if (x == 0 || y == 0 || x == 32 || y == 32) {
        EXPECT_EQ(Decode(tile, k), SnapHeight(sample, step));
      } else {
        EXPECT_LE(std::abs(Decode(tile, k) - sample), step / 2);
      }
    }
    const double low = *std::min_element(tile.h.begin(), tile.h.end()),
                 high = *std::max_element(tile.h.begin(), tile.h.end());
    const double range = static_cast<double>(tile.max_height) - static_cast<double>(tile.min_height);
    const double ulp = std::ldexp(1.0, std::ilogb(std::max(std::abs(tile.min_height), std::abs(tile.max_height))) - 23);
    EXPECT_LE(range, 2 * range * (high - low) / kQuantizedMax * 1.001 + kQuantizedMax * ulp);
  }
}

TEST(QuantizeTile, KeepsAFlatTileFlat) {
  const Ground ground({9, 500, 300}, 32, [](int, int) { return -3.25; });
  const QuantizedTile tile = QuantizeTile(ground.view(), TwoTriangles(32), AllSteps(0.25));
  EXPECT_EQ(tile.min_height, -3.25f);
  EXPECT_EQ(tile.max_height, -3.25f);
  for (const std::uint16_t h : tile.h) EXPECT_EQ(h, 0);
}

TEST(TileErrorMeter, FindsOneLiftedSample) {
  // The tile is so small that the Earth's curvature does not matter.
  const Ground ground({18, 138240, 184320}, 64, [](int i, int j) { return i == 20 && j == 31 ? 107.5 : 100; });
  const QuantizedTile tile = QuantizeTile(ground.view(), TwoTriangles(64), AllSteps(0.25));
  const TileError error = TileErrorMeter(ground.view(), 5).Measure(tile);
  EXPECT_NEAR(error.max_m, 7.5, 0.001);
  ASSERT_EQ(error.to_insert.size(), 1u);
  EXPECT_EQ(error.to_insert[0], (tin::SamplePosition{20, 31}));
  EXPECT_TRUE(TileErrorMeter(ground.view(), 7.501).Measure(tile).to_insert.empty());
}

TEST(TileErrorMeter, DoesNotOfferEdgeSamples) {
  const Ground ground({18, 138240, 184320}, 32, [](int i, int j) { return i == 0 && j == 7 ? 150 : 100; });
  const TileError error =
      TileErrorMeter(ground.view(), 5).Measure(QuantizeTile(ground.view(), TwoTriangles(32), AllSteps(0.25)));
  EXPECT_NEAR(error.max_m, 50, 0.001);
  EXPECT_TRUE(error.to_insert.empty());
}

TEST(TileErrorMeter, SeesEverySampleOfAFullMesh) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> height(0, 100);
  const Ground ground({13, 4300, 5700}, 128, [&](int, int) { return height(random); });
  const QuantizedTile tile = QuantizeTile(ground.view(), EverySample(128), AllSteps(1.0 / 64));
  // Half a height step, and half a unit of position in both axes on slopes of up to 100 m per cell.
  EXPECT_LE(TileErrorMeter(ground.view(), 1).Measure(tile).max_m, 1.0 / 128 + 2 * 100 * 128 / (2.0 * kQuantizedMax));
}

// Two flat triangles over an ocean tile are below it by the sagitta: 60 m at level 9 at the equator.
TEST(TileErrorMeter, CountsTheCurvatureOfTheEarth) {
  const Ground ground({9, 512, 256}, 64, [](int, int) { return 0; });
  const QuantizedTile tile = QuantizeTile(ground.view(), TwoTriangles(64), AllSteps(1));
  const double side = geo::kSemiMajorAxis * geo::ToRadians(180.0 / 512);
  EXPECT_NEAR(TileErrorMeter(ground.view(), 1000).Measure(tile).max_m, side * side / (4 * geo::kSemiMajorAxis), 0.6);
}

TEST(AllCounterClockwise, NoticesATurnedTriangle) {
  const Ground ground({9, 512, 256}, 64, [](int, int) { return 0; });
  QuantizedTile tile = QuantizeTile(ground.view(), TwoTriangles(64), AllSteps(1));
  EXPECT_TRUE(AllCounterClockwise(tile));
  std::swap(tile.triangles[1][0], tile.triangles[1][1]);
  EXPECT_FALSE(AllCounterClockwise(tile));
}

}  // namespace
}  // namespace terrace::proto
