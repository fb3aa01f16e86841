// What an archive stores for a tile besides its bytes: a row of fixed size with a checksum over the row, the tile's
// number and the bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/common/dem_types.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::archive {

inline constexpr std::size_t kRowBytes = 48;

std::string EncodeRow(std::uint64_t tile_id, const tiler::EncodedTile& tile, const dem::HeightRange& range);

struct ArchivedTile {
  tiler::EncodedTile tile;  // as it was added, without etag, times and header_lines
  dem::HeightRange range;
};

// Nothing: the row does not belong to this tile and these bytes, or one of them is damaged (missed with a probability
// of 2^-64).
std::optional<ArchivedTile> DecodeRow(std::uint64_t tile_id, std::string_view row, std::string bytes);

}  // namespace terrace::archive
