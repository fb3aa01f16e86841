#include "proto/mesh/water_mask.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace terrace::proto {
namespace {

// Heights at global nodes; the halo is NaN, because it must not be read.
struct WaterTile {
  WaterTile(geo::TileKey key, int cells, const std::function<float(std::int64_t, std::int64_t)>& height)
      : view{key, {key.level, cells}, {}} {
    for (int j = -1; j <= cells + 1; ++j) {
      for (int i = -1; i <= cells + 1; ++i) {
        const bool is_halo = i < 0 || j < 0 || i > cells || j > cells;
        heights.push_back(is_halo ? NAN : height(view.lattice.FirstColumn(key) + i, view.lattice.FirstRow(key) + j));
      }
    }
    view.heights = heights;
  }
  std::vector<float> heights;
  TileSamples view;
};

int Pixel(const WaterMask& mask, int row, int column) {
  return mask.at(static_cast<std::size_t>(row * kWaterMaskSide + column));
}

TEST(SeaLevelMask, RowsRunFromTheNorthAndColumnsFromTheWest) {
  // Only the north-western quarter is under water.
  const WaterTile tile({4, 5, 6}, 256, [](std::int64_t column, std::int64_t row) {
    return column - 5 * 256 < 128 && row - 6 * 256 >= 128 ? -10.0f : 10.0f;
  });
  const WaterMask mask = SeaLevelMask(tile.view, 0);
  EXPECT_EQ(Pixel(mask, 0, 0), 255);
  EXPECT_EQ(Pixel(mask, 100, 100), 255);
  EXPECT_EQ(Pixel(mask, 0, 255), 0);
  EXPECT_EQ(Pixel(mask, 255, 0), 0);
  EXPECT_EQ(Pixel(mask, 255, 255), 0);
}

TEST(SeaLevelMask, TheLevelItselfIsWater) {
  const auto flat = [](float height) {
    return WaterTile({3, 1, 1}, 64, [=](std::int64_t, std::int64_t) { return height; });
  };
  EXPECT_EQ(Shortest(SeaLevelMask(flat(0).view, 0)), WaterMask{255});
  EXPECT_EQ(Shortest(SeaLevelMask(flat(0.0009765625f).view, 0)), WaterMask{0});
  EXPECT_EQ(Shortest(SeaLevelMask(flat(-2).view, -3)), WaterMask{0});
}

TEST(SeaLevelMask, ACoastIsWaterByItsShare) {
  // Heights rise to the east and pass 0 in the middle of pixel 100, whatever the lattice.
  for (const int cells : {32, 64, 128, 256}) {
    const double column_of_coast = 100.5 * cells / 256;
    const WaterTile tile({2, 0, 0}, cells, [=](std::int64_t column, std::int64_t) {
      return static_cast<float>(static_cast<double>(column) - column_of_coast);
    });
    const WaterMask mask = SeaLevelMask(tile.view, 0);
    EXPECT_EQ(Pixel(mask, 7, 99), 255) << cells;
    EXPECT_EQ(Pixel(mask, 7, 100), 128) << cells;
    EXPECT_EQ(Pixel(mask, 7, 101), 0) << cells;
  }
}

// The same ground in a tile and in its neighbour: the masks are equal after a shift by one tile.
TEST(SeaLevelMask, IsAFunctionOfTheGlobalPosition) {
  const auto waves = [](std::int64_t column, std::int64_t row) {
    return static_cast<float>(static_cast<int>((column * 7 + row * 13) % 32) - 16);  // repeats every 32 columns
  };
  const WaterTile tile({6, 40, 20}, 128, waves), east({6, 41, 20}, 128, waves);
  EXPECT_EQ(SeaLevelMask(tile.view, 0), SeaLevelMask(east.view, 0));
}

TEST(Shortest, KeepsAMaskWithTwoKindsOfPixels) {
  WaterMask mask(std::size_t{kWaterMaskSide} * kWaterMaskSide, 255);
  mask.back() = 254;
  EXPECT_EQ(Shortest(mask), mask);
  mask.back() = 255;
  EXPECT_EQ(Shortest(mask), WaterMask{255});
}

}  // namespace
}  // namespace terrace::proto
