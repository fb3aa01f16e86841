// The metadata of a tile (quantized-mesh extension 4): the tiles that exist below it, for clients that do not read the
// whole `available` of layer.json.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::proto {

// Whether a tile has metadata: tiles of levels 0, N, 2N and so on have it, for N = `metadata_availability`
// (layer.json's metadataAvailability); 0: no tile. `max_source_level`: the deepest level of the sources. Tiles of
// this level and of deeper ones, which edits may add, have metadata only if they have children. `available`: as below.
bool CarriesMetadata(const geo::TileKey& key, int metadata_availability, int max_source_level,
                     std::span<const std::vector<geo::TileRange>> available);

// {"available":[[ranges of the next level], [of the one after it], ...]}: the part of `available` below the tile, for
// `metadata_availability` levels. `available` is by level, from 0. Columns and rows are global, from the south.
std::string EncodeTileMetadata(const geo::TileKey& key, std::span<const std::vector<geo::TileRange>> available,
                               int metadata_availability);

}  // namespace terrace::proto
