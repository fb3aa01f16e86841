// What the tiles of a subtree depend on, for bakes that keep what has not changed.
#pragma once

#include "engine/common/content_hash.h"
#include "engine/dem/elevation_model.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// A hash of everything that the heights and range bounds of tiles from `top` down to level `deepest` depend on:
// samples within reach, positions, voids, options, and the bounds of the tiles around. Equal hashes: Read gives the
// same bits for each of these tiles, and RangeBound the same ranges for them and their neighbours. On levels deeper
// than max_source_level() this holds for available tiles only. A change of a source near the tiles may change the
// hash although no height changes. Precondition: top is a valid key, top.level <= deepest <= geo::kMaxLevel.
ContentHash ContentBelow(const ElevationModel& model, const geo::TileKey& top, int deepest);

}  // namespace terrace::dem
