// Steps between the positions of neighbouring nodes, with SIMD. Results are bit-equal on all instruction sets.
#pragma once

#include <cstddef>

#include "engine/bound/tile_cells.h"
#include "engine/crs/projector.h"

namespace terrace::dem {

// Largest steps between neighbouring nodes of a box (east_*, north_*), and largest difference between two steps that
// follow each other (bend_*): twice the distance of the middle node from the midpoint of its neighbours.
struct NodeSteps {
  double east_x = 0, east_y = 0, north_x = 0, north_y = 0, bend_x = 0, bend_y = 0;
};

// Measures a box of columns x rows cells and adds its nodes to `at`, in the unit of the positions. `southwest`: the
// box's south-western node, in rows of `stride` nodes from the south. Returns false if a node or a neighbour of one has
// no position (NaN).
bool MeasureSteps(const Position* southwest, std::size_t stride, int columns, int rows, NodeSteps& steps,
                  PixelBounds& at);

}  // namespace terrace::dem
