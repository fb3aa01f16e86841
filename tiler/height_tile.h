// Height tiles: PNG images whose colours are heights, for MapLibre's and others' raster-dem sources.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "tiler/encoded_tile.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// One pixel per node of the Web Mercator grid, none of them shared with a neighbour: clients fetch their borders
// themselves. EncodedTile::max_error_m is what the colours' steps lose, measured. kNotFound: deeper than the source
// warrants. kUnavailable, kCancelled: as DemSource. Precondition: a kHeightPng request.
Result<EncodedTile> BuildHeightTile(const dem::DemSource& source, const TileRequest& request, std::stop_token stop);

}  // namespace terrace::tiler
