// The error of a decoded tile, computed independently of the encoder's measurement.
#pragma once

#include <vector>

#include "engine/dem/elevation_model.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::tiler {

// The error of every lattice sample in metres, by rows from the south, against the surface interpolated in longitude
// and latitude. Infinite if no triangle covers the sample; all are infinite if a triangle is not counter-clockwise.
std::vector<double> DecodedErrors(const proto::DecodedTile& tile, const dem::TileHeights& heights);

// The largest of them.
double DecodedError(const proto::DecodedTile& tile, const dem::TileHeights& heights);

}  // namespace terrace::tiler
