// The tiles that `precision` asks for on levels deeper than the sources' (docs/edits.md).
#pragma once

#include <vector>

#include "engine/edits/edit.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// The levels that edits may add below the deepest one of the sources.
inline constexpr int kMaxDeeperLevels = 6;

// The first level whose default error is at most the edit's `error_m`, at most `deepest`; -1: the edit is not
// `precision`, has no `error_m`, or begins on a deeper level (`min_level`).
int LevelFor(const Edit& edit, double error_fraction, int deepest);

// The tiles of a level that its polygon or the width of its line touches, without the blend. Large edits get a few
// tiles more at their rim: the test is of at most 64 x 64 boxes of tiles.
std::vector<geo::TileRange> TilesTouching(const Edit& edit, int level);

}  // namespace terrace::dem
