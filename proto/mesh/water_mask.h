// The water mask of a tile (quantized-mesh extension 2): the pixels that clients draw as water.
// A mask has a single value if all pixels are equal, else kWaterMaskSide x kWaterMaskSide values, row by row from the
// NORTH-western pixel: 0 is land, 255 water. Values in between are the share of water in a pixel on the coast.
#pragma once

#include <cstdint>
#include <vector>

#include "proto/tile_samples.h"

namespace terrace::proto {

inline constexpr int kWaterMaskSide = 256;

using WaterMask = std::vector<std::uint8_t>;

// A place is water if the bilinear surface through the lattice's samples lies at or below `sea_level_m`. A pixel
// depends only on its level and global position. The halo is not used. Precondition: kWaterMaskSide is a multiple of
// the lattice's cells.
WaterMask SeaLevelMask(const TileSamples& samples, double sea_level_m);

// Reduces a mask of equal pixels to a single value.
WaterMask Shortest(WaterMask mask);

}  // namespace terrace::proto
