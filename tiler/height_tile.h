// Height tiles: PNG images whose colours are heights, for MapLibre's and others' raster-dem sources.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "tiler/encoded_tile.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// One pixel for each node of the Web Mercator grid. Tiles share no pixels with neighbours. EncodedTile::max_error_m is
// the measured rounding error of the colours. kNotFound: deeper than max_mercator_depth. kUnavailable, kCancelled: as
// DemSource. Precondition: a kHeightPng request.
Result<EncodedTile> BuildHeightTile(const dem::DemSource& source, const TileRequest& request, std::stop_token stop);

}  // namespace terrace::tiler
