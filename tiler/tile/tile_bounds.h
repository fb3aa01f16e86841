// The two tiling schemes: TMS geodetic with two roots, and Web Mercator's XYZ.
#pragma once

#include "engine/common/dem_types.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {

// Whether the scheme has such a tile.
bool IsInScheme(const geo::TileKey& key, bool is_mercator);

// Degrees. Precondition: IsInScheme.
dem::GeoBounds TileBounds(const geo::TileKey& key, bool is_mercator);

}  // namespace terrace::tiler
