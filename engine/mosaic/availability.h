// Availability of tiles in a dataset of many sources: deep tiles exist only where a fine source is.
#pragma once

#include <span>
#include <vector>

#include "engine/crs/footprint.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// A source's footprint, without padding, and the deepest level that its resolution justifies.
struct SourceExtent {
  Footprint footprint;
  int deepest_level = 0;
};

// Tiles of a level that exist for another reason than a source's resolution.
struct FinerTiles {
  int level = 0;
  std::vector<geo::TileRange> tiles;
};

// For each level from 0 to the deepest: ranges of tiles without overlap, sorted by row, then column, that contain
// - every tile that overlaps a source whose deepest level is at least this one;
// - every ancestor of such a tile, and both roots;
// - all four children of a tile that has any: 3D Tiles clients replace a tile by its children, and a missing child is a
//   hole.
// A level with too many ranges for its documents gets fewer and larger ones, which include tiles outside all sources.
// Precondition: `sources` is not empty.
std::vector<std::vector<geo::TileRange>> AvailableTiles(std::span<const SourceExtent> sources);

// Adds tiles to a result of AvailableTiles, also on deeper levels, with the ancestors and siblings that the rules above
// ask for. A tile that is added has tiles of its level or the next shallower one on all sides, because skirts hide gaps
// between neighbours that differ by one level (proto/mesh/skirt.h). Returns the tiles that were added, by level from 0,
// as ranges without overlap; empty if `finer` is.
std::vector<std::vector<geo::TileRange>> AddTiles(std::vector<std::vector<geo::TileRange>>& levels,
                                                  std::span<const FinerTiles> finer);

}  // namespace terrace::dem
