// Areas made of rectangles of whole cells: of tiles, or of the pixels of a raster.
#pragma once

#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::geo {

// Rectangles without overlap that cover what `ranges` cover, sorted by start_y, then start_x. What lies side by side
// is one rectangle, and so is what lies on top of each other with the same columns.
std::vector<TileRange> Disjoint(std::vector<TileRange> ranges);

// The smallest range that holds both ranges.
TileRange Hull(const TileRange& a, const TileRange& b);

// Empty (end before start) where they do not meet.
TileRange Common(const TileRange& a, const TileRange& b);
constexpr bool IsEmpty(const TileRange& range) { return range.end_x < range.start_x || range.end_y < range.start_y; }
constexpr std::int64_t Cells(const TileRange& range) {
  return IsEmpty(range) ? 0 : (range.end_x - range.start_x + 1) * (range.end_y - range.start_y + 1);
}

}  // namespace terrace::geo
