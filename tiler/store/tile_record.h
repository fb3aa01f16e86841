// Serialization for stores that outlive the process: keys, encoded tiles, refined tiles.
//
// A key holds everything that its value depends on within one build of the program: the request, the hash of the edits
// that the tile depends on, and the dataset's cache generation, which identifies the dataset without its edits.
// The checksum detects damage, not forgery: only trusted programs may write to a store.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "tiler/store/refined_tile.h"
#include "tiler/store/tile_store.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {

// Different keys have different bytes. TileRequest::dataset is not part of them.
std::string RecordKey(const CacheKey& key);
std::string RecordKey(const RefinedTileKey& key);

// The prefix of the keys of a generation's records of one level. Other keys do not begin with it.
std::string RecordPrefix(std::uint64_t generation, int level);
// The same for the records of all levels.
std::string RecordPrefix(std::uint64_t generation);
// Whether a record's key belongs to a selected tile or to the refinement of one.
bool IsSelected(const TileSelection& selection, std::string_view record_key);

std::string SerializeTile(const EncodedTile& tile);
// The times of the build are zero. kInvalidArgument: not written by SerializeTile.
Result<EncodedTile> ParseTile(std::string_view bytes);

// Precondition: the tile has a refinement.
std::string SerializeRefinedTile(const RefinedTile& tile);
// kInvalidArgument: not written by SerializeRefinedTile.
Result<RefinedTile> ParseRefinedTile(std::string_view bytes);

// Values of a store with a checksum over key and value, so that a damaged or misplaced value is detected.
std::string AddChecksum(std::string_view key, std::string value);

// The value within `sealed`, or nothing if its bits, length or key differ (with a probability of 1 - 2^-64).
std::optional<std::string_view> StripChecksum(std::string_view key, std::string_view sealed);

}  // namespace terrace::tiler
