#include "proto/tile_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "proto/tile_mesh.h"
#include "tests/proto/ground.h"

namespace terrace::proto {
namespace {

EdgeSteps FineSteps() { return {{0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}, {0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}}; }

// Every node against every triangle, by signs of areas alone.
double LargestError(const LatticeView& lattice, const QuantizedTile& tile) {
  const std::int64_t cells = lattice.cells();
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
        const double sample = lattice.At(static_cast<int>(i), static_cast<int>(j));
        largest = std::max(largest, std::abs(surface - sample));
      }
    }
  }
  return largest;
}

// Rounded positions leave the nodes, so that slivers lie between rows and edges pass nodes by a hair.
TEST(TileError, FindsTheLargestErrorThatAnySampleHas) {
  for (const int cells : {32, 64}) {
    // The reference looks for every sample in every triangle: few of the large ones, which are slow under sanitizers.
    for (unsigned seed = 0; seed < 6; seed += cells == 32 ? 1 : 5) {
      const RandomGround ground({9, 300, 400}, cells, 256, seed);
      const QuantizedTile tile =
          QuantizeTile(ground.view(), GreedyMesh(ground.view(), {.max_error = 40.0 + 20 * seed}), FineSteps());
      const TileError error = MeasureTileError(ground.view(), tile, 1e9, false);
      EXPECT_NEAR(error.max_m, LargestError(ground.view(), tile), 1e-6) << cells << ' ' << seed;
      EXPECT_TRUE(error.misses.empty());
    }
  }
}

TEST(TileError, ListsForEachTriangleASampleThatMissesTheBound) {
  const RandomGround ground({9, 300, 400}, 64, 256, 9);
  const QuantizedTile tile = QuantizeTile(ground.view(), GreedyMesh(ground.view(), {.max_error = 120}), FineSteps());
  const TileError error = MeasureTileError(ground.view(), tile, 60, false);
  ASSERT_FALSE(error.misses.empty());
  EXPECT_LE(error.misses.size(), tile.triangles.size());
  for (const tin::SamplePosition miss : error.misses) {
    EXPECT_TRUE(miss.x > 0 && miss.y > 0 && miss.x < 64 && miss.y < 64);
  }
}

}  // namespace
}  // namespace terrace::proto
