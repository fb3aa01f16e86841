// Names and paths of the units of an archive: files of tiles.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "engine/geo/tile_key.h"

namespace terrace::archive {

// Levels 0 .. kTopLevels - 1 are the unit "top"; each tile of level kTopLevels is the root of a further unit.
inline constexpr int kTopLevels = 7;

// The unit of a tile: "top" or "7-X-Y". UnitRoot is its inverse: the root's key, nothing for "top".
// kInvalidArgument: no such name.
std::string UnitNameOf(const geo::TileKey& key);
Result<std::optional<geo::TileKey>> UnitRoot(std::string_view name);

// Relative to the archive's place: "top.pmtiles", "units/7-X-Y.pmtiles".
std::string UnitPath(std::string_view name);

}  // namespace terrace::archive
