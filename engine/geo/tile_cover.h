// Areas as sets of rectangles of tiles or pixels.
#pragma once

#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::geo {

// Returns rectangles without overlap that cover the same cells as `ranges`, sorted by start_y, then start_x. Merges
// rectangles that are adjacent in a row, and rectangles above each other with the same columns.
std::vector<TileRange> Disjoint(std::vector<TileRange> ranges);

// Whether a tile lies in one of the ranges of its level.
bool Contains(const std::vector<TileRange>& ranges, const TileKey& key);
// Whether a tile is valid and available. `available`: the ranges of each level, from 0.
bool IsAvailable(const std::vector<std::vector<TileRange>>& available, const TileKey& key);

// Returns the tiles of `level` in `key`. Precondition: level >= key.level.
constexpr TileRange TilesBelow(const TileKey& key, int level) {
  const int down = level - key.level;
  return {key.x << down, key.y << down, ((key.x + 1) << down) - 1, ((key.y + 1) << down) - 1};
}

// Returns the part of `ranges`, of tiles of `level`, that lies in `key`, as Disjoint does: it is the same however the
// tiles are divided into ranges.
std::vector<TileRange> RangesBelow(const std::vector<TileRange>& ranges, const TileKey& key, int level);

// Returns the smallest range that contains both ranges.
TileRange BoundingRange(const TileRange& a, const TileRange& b);

// Returns the intersection; empty (end before start) if there is none.
TileRange Intersection(const TileRange& a, const TileRange& b);
constexpr bool IsEmpty(const TileRange& range) { return range.end_x < range.start_x || range.end_y < range.start_y; }
constexpr std::int64_t Cells(const TileRange& range) {
  return IsEmpty(range) ? 0 : (range.end_x - range.start_x + 1) * (range.end_y - range.start_y + 1);
}

}  // namespace terrace::geo
