// Serialization for stores that outlive the process: keys, encoded tiles, refined tiles.
//
// A key holds everything that its value depends on within one build of the program: the dataset's generation, which
// identifies the dataset, and the request. seal.h detects damage, not forgery: trust the store.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "tiler/encoded_tile.h"
#include "tiler/store/refined_tile.h"
#include "tiler/store/tile_cache.h"

namespace terrace::tiler {

// Different keys have different bytes. TileRequest::dataset is not part of them.
std::string RecordKey(const CacheKey& key);
std::string RecordKey(const RefinedTileKey& key);

std::string SerializeTile(const EncodedTile& tile);
// The times of the build are zero. kInvalidArgument: not written by SerializeTile.
Result<EncodedTile> ParseTile(std::string_view bytes);

std::string SerializeRefinedTile(const RefinedTile& tile);
// kInvalidArgument: not written by SerializeRefinedTile.
Result<RefinedTile> ParseRefinedTile(std::string_view bytes);

}  // namespace terrace::tiler
