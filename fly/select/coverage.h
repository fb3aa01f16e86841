// What part of the screen shows nothing, although the server has terrain there.
#pragma once

#include <cstdint>

#include "fly/scene/view.h"
#include "fly/select/select.h"

namespace terrace::fly {

// Counts of rays through a grid of 23 x 13 points of the screen that meet a tile.
struct Coverage {
  int rays = 0;
  int missing = 0;    // a selected tile is not loaded, or failed
  int uncovered = 0;  // no tile was selected: a fault of selection
  int doubled = 0;    // more than one was

  int holes() const { return missing + uncovered; }
};

// Sends rays to the lowest surface that the volumes of all tiles there allow: where such a point is on the screen, none
// of the tiles may be culled. Points in fog do not count, nor those where the deepest tile has no child: there the data
// end. Call it after SelectTiles for the same frame.
Coverage MeasureCoverage(const View& view, std::uint64_t frame, const Tile& root);

}  // namespace terrace::fly
