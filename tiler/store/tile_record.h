// Cached things as bytes, for a store that outlives the process: keys, encoded tiles, refined tiles.
//
// A key holds everything its value depends on within one build of the program: the dataset's generation, which stands
// for the dataset, and the request. The values are as trustworthy as the store: seal.h finds damage, not malice.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "tiler/encoded_tile.h"
#include "tiler/store/refined_tile.h"
#include "tiler/store/tile_cache.h"

namespace terrace::tiler {

// Different keys have different bytes. TileRequest::dataset is not in them.
std::string RecordKey(const CacheKey& key);
std::string RecordKey(const RefinedTileKey& key);

std::string SerializeTile(const EncodedTile& tile);
// Without the times of the build. kInvalidArgument: not what SerializeTile writes.
Result<EncodedTile> ParseTile(std::string_view bytes);

std::string SerializeRefinedTile(const RefinedTile& tile);
// kInvalidArgument: not what SerializeRefinedTile writes.
Result<RefinedTile> ParseRefinedTile(std::string_view bytes);

}  // namespace terrace::tiler
