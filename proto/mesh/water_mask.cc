#include "proto/mesh/water_mask.h"

#include <algorithm>
#include <cstddef>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

// The heights at the corners of a lattice cell.
struct Corners {
  double south_west, south_east, north_west, north_east;

  // x, y in 0 .. 1 from the south-west.
  double At(double x, double y) const {
    const double south = south_west + (south_east - south_west) * x;
    const double north = north_west + (north_east - north_west) * x;
    return south + (north - south) * y;
  }
};

// The share of a pixel at or below sea level, from 4 x 4 points in it. `x`, `y`, `size`: the pixel in its cell, from
// the south-west.
std::uint8_t Share(const Corners& corners, double x, double y, double size, double sea_level) {
  constexpr int kPoints = 4;
  int wet = 0;
  for (int j = 0; j < kPoints; ++j) {
    for (int i = 0; i < kPoints; ++i) {
      if (corners.At(x + size * (i + 0.5) / kPoints, y + size * (j + 0.5) / kPoints) <= sea_level) ++wet;
    }
  }
  constexpr int kAll = kPoints * kPoints;
  return static_cast<std::uint8_t>((255 * wet + kAll / 2) / kAll);
}

}  // namespace

WaterMask SeaLevelMask(const TileSamples& samples, double sea_level_m) {
  TERRACE_CHECK(kWaterMaskSide % samples.cells() == 0);
  const int pixels = kWaterMaskSide / samples.cells();  // along a cell's edge
  const double size = 1.0 / pixels;
  WaterMask mask(std::size_t{kWaterMaskSide} * kWaterMaskSide);
  for (int j = 0; j < samples.cells(); ++j) {
    for (int i = 0; i < samples.cells(); ++i) {
      const Corners corners{static_cast<double>(samples.At(i, j)), static_cast<double>(samples.At(i + 1, j)),
                            static_cast<double>(samples.At(i, j + 1)), static_cast<double>(samples.At(i + 1, j + 1))};
      const auto [lowest, highest] =
          std::minmax({corners.south_west, corners.south_east, corners.north_west, corners.north_east});
      // The surface in a cell lies between the lowest and the highest corner.
      const bool is_wet = highest <= sea_level_m, is_dry = lowest > sea_level_m;
      for (int y = 0; y < pixels; ++y) {
        const int row = kWaterMaskSide - 1 - (j * pixels + y);
        std::uint8_t* const out = mask.data() + row * kWaterMaskSide + i * pixels;
        for (int x = 0; x < pixels; ++x) {
          out[x] = is_wet ? 255 : is_dry ? 0 : Share(corners, x * size, y * size, size, sea_level_m);
        }
      }
    }
  }
  return mask;
}

WaterMask Shortest(WaterMask mask) {
  if (std::all_of(mask.begin(), mask.end(), [&](std::uint8_t pixel) { return pixel == mask.front(); })) mask.resize(1);
  return mask;
}

}  // namespace terrace::proto
