// The water mask of a tile (quantized-mesh extension 2): which of its pixels clients draw as water.
//
// A mask is one value where the whole tile has it, else kWaterMaskSide x kWaterMaskSide of them, row by row from the
// NORTH-western pixel: 0 is land, 255 water, and between them how much of a pixel on the coast is water.
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

// One value for a mask whose pixels are all alike.
WaterMask Shortest(WaterMask mask);

}  // namespace terrace::proto
