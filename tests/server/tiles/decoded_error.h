// How far a decoded tile is off, by code that has nothing in common with the encoder's own measure.
#pragma once

#include "engine/dem/dem_source.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::server {

// Metres, over every lattice sample of the tile, against the surface interpolated in longitude and latitude; infinite
// where no triangle covers a sample or one is not counter-clockwise.
double DecodedError(const proto::DecodedTile& tile, const dem::TileHeights& heights);

}  // namespace terrace::server
