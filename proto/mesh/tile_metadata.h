// The metadata of a tile (quantized-mesh extension 4): which tiles there are below it, for clients that do not read all
// of layer.json's `available`.
#pragma once

#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::proto {

// Whether a tile carries metadata where every `metadata_levels`-th level does (layer.json's metadataAvailability):
// those of levels 0, N, 2N ..., save on the deepest level. 0: none does.
bool CarriesMetadata(int level, int metadata_levels, int max_level);

// {"available":[[ranges of the next level], [of the one after it], ...]}: what `available`, by level from 0, has below
// the tile, down to `metadata_levels` levels deeper. Columns and rows are those of the whole level, from the south.
std::string EncodeTileMetadata(const geo::TileKey& key, const std::vector<std::vector<geo::TileRange>>& available,
                               int metadata_levels);

}  // namespace terrace::proto
