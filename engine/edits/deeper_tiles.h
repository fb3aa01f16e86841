// The tiles that `precision` asks for on levels deeper than the sources' (docs/edits.md).
#pragma once

#include <vector>

#include "engine/edits/edit.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// The levels that edits may add below the deepest one of the sources.
inline constexpr int kMaxDeeperLevels = 6;

// The first level whose default error is at most the edit's `error_m`, at most `deepest`. -1: the edit is not
// `precision`, has no `error_m`, or its `min_level` is deeper.
int LevelFor(const Edit& edit, double error_fraction, int deepest);

// The tiles of a level that the edit's polygon or the width of its line touches, without the blend. At most 64 x 64
// boxes of tiles are tested, so large edits get a few tiles more at their rim.
std::vector<geo::TileRange> TilesTouching(const Edit& edit, int level);

}  // namespace terrace::dem
