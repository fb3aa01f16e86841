// Which tiles a dataset of many sources has: deep ones only where a fine source lies.
#pragma once

#include <span>
#include <vector>

#include "engine/dem/crs/footprint.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// A source's place, not padded, and the deepest level that it is worth.
struct Reach {
  Footprint footprint;
  int depth = 0;
};

// Per level 0 .. the deepest: blocks without overlap, sorted by row, then column, that hold
// - every tile that a source touches which is worth this level;
// - every ancestor of such a tile, and both roots;
// - all four children of a tile that has any: 3D Tiles clients replace a tile by its children, so a missing child is a
// hole. A level of more blocks than its description may grow to is made of larger ones, with tiles outside all sources.
// Precondition: not empty.
std::vector<std::vector<geo::TileRange>> AvailableTiles(std::span<const Reach> sources);

}  // namespace terrace::dem
