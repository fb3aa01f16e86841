// The edges of other tiles that meet at a tile's corners. The height step of a corner must suit the samples on all
// edges that end there, and all tiles around it must find the same step (proto/mesh/edge_steps.h).
#pragma once

#include <array>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/geo/lattice.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// For the south-western, south-eastern, north-eastern and north-western corner: the nodes of the edges that end there
// and are not the tile's own, without their ends. None beyond a pole. Columns are 0 .. columns() - 1.
std::array<std::vector<NodeWindow>, 4> EdgesBeyondCorners(const geo::Lattice& lattice, const geo::TileKey& key);

}  // namespace terrace::dem
