// The water mask of a tile (quantized-mesh extension 2): the pixels that clients draw as water.
//
// A mask is a single value if the whole tile has it, else kWaterMaskSide x kWaterMaskSide values, row by row from the
// NORTH-western pixel: 0 is land, 255 water. Values in between are the share of water in a pixel on the coast.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/lattice_view.h"

namespace terrace::proto {

inline constexpr int kWaterMaskSide = 256;

using WaterMask = std::vector<std::uint8_t>;

// Water is where the surface through the lattice's samples, bilinear between them, lies at `sea_level_m` or below.
// A pixel is a function of its level and global position alone. Preconditions: kWaterMaskSide is a multiple of the
// lattice's cells; the halo is not looked at.
WaterMask SeaLevelMask(const LatticeView& lattice, double sea_level_m);

// Reduces a mask of equal pixels to a single value.
WaterMask Shortest(WaterMask mask);

}  // namespace terrace::proto
