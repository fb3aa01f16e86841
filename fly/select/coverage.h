// The part of the screen that shows nothing although the server has terrain there.
#pragma once

#include <cstdint>

#include "fly/scene/view.h"
#include "fly/select/select.h"

namespace terrace::fly {

// Counts rays through 23 x 13 points of the screen. `rays`: those that meet a tile.
struct Coverage {
  int rays = 0;
  int missing = 0;    // a selected tile is not loaded, or failed
  int uncovered = 0;  // no tile was selected: a fault of selection
  int doubled = 0;    // more than one tile was selected

  int holes() const { return missing + uncovered; }
};

// Intersects each ray with the surface at the smallest height that is inside the height ranges of all tiles at that
// point. Such a point is in the volumes of all these tiles, so that none of them may be culled. Points in fog, and
// points where an empty tile is drawn, do not count. Where no tile was selected, neither do points outside of a height
// range, and points where the deepest tile has children but none at that point: there the data end. Call it after
// SelectTiles for the same frame.
Coverage MeasureCoverage(const View& view, std::uint64_t frame, const Tile& root);

}  // namespace terrace::fly
