// How far a decoded tile is off, by code that has nothing in common with the encoder's own measure.
#pragma once

#include <vector>

#include "engine/dem/dem_source.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::tiler {

// Metres, of every lattice sample of the tile, by rows from the south, against the surface interpolated in longitude
// and latitude; infinite where no triangle covers a sample, and all of them if a triangle is not counter-clockwise.
std::vector<double> DecodedErrors(const proto::DecodedTile& tile, const dem::TileHeights& heights);

// The largest of them.
double DecodedError(const proto::DecodedTile& tile, const dem::TileHeights& heights);

}  // namespace terrace::tiler
