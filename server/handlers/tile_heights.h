// How far a GLB tile reaches up and down, known before it is made: what tilesets say of it.
#pragma once

#include "engine/geo/tile_key.h"
#include "proto/height_span.h"
#include "server/query/query.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Heights that no vertex of the tile and of any below it leaves at this error, feet of skirts included: the bound on
// the tile's samples, widened by skirts and rounding, and outwards to whole steps of a power of two, at most a quarter
// of the error and at least 2^-6 m: they make short numbers, and many equal ones. Reads no raster. Any valid key;
// thread-safe.
proto::HeightSpan HeightsOfTile(const DatasetView& dataset, const RequestedError& requested, const geo::TileKey& key);

}  // namespace terrace::server
