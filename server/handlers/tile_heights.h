// Bounds on the heights of a GLB tile, for tilesets. Known before the tile is built.
#pragma once

#include "engine/geo/tile_key.h"
#include "proto/height_span.h"
#include "server/query/query.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Returns a range that contains the heights of all vertices, including skirts, of the tile and its descendants at this
// error. It is the bound on the tile's samples, widened by skirts and rounding, and then outwards to multiples of a
// power of two, which is at most a quarter of the error and at least 2^-6 m: such numbers are short and often equal.
// Reads no raster. Thread-safe. Precondition: a valid key.
proto::HeightSpan HeightsOfTile(const DatasetView& dataset, const RequestedError& requested, const geo::TileKey& key);

}  // namespace terrace::server
