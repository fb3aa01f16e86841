// How tiles of both schemes lie in PMTiles files, and what the metadata of such files say.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "archive/pmtiles/pmtiles_writer.h"
#include "archive/pmtiles/tile_id.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"
#include "tiler/tile/tile_request.h"

namespace terrace::archive {

// A geodetic level has two roots and is as wide as the next level of PMTiles: level z lies at z + 1, columns and rows
// keep their numbers. Precondition: tiler::IsInScheme.
PmtilesKey PmtilesKeyOf(const geo::TileKey& key, bool is_mercator);
// Nothing: there is no such tile.
std::optional<geo::TileKey> TileKeyOf(std::uint64_t tile_id, bool is_mercator);

// `root`: of the unit, for the bounds of the file; nothing: those of the whole world. kInvalidArgument: archives do not
// hold tiles in this coding.
Result<PmtilesOptions> PmtilesOptionsOf(const tiler::TileRequest& kind, const std::optional<geo::TileKey>& root);

// "quantized-mesh-1.0", "glb", "png"; and the media type of a tile.
std::string_view FormatName(tiler::TileFormat format);
std::string_view MediaTypeOf(tiler::TileFormat format);

// JSON with the unit's key.
std::string UnitMetadata(const tiler::TileRequest& kind, std::uint64_t key);
// Nothing: the metadata are not those of a unit.
std::optional<std::uint64_t> UnitKeyIn(std::string_view metadata);

}  // namespace terrace::archive
