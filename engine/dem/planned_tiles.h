// The tiles that a box overlaps, and those that rasters would have, from their bounds and spacing. Opens no rasters.
#pragma once

#include <span>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// The tiles of a level that overlap a box, as one range, or two across the antimeridian. Tiles that share only an edge
// with it do not overlap it.
std::vector<geo::TileRange> TilesOverlapping(const GeoBounds& box, int level);

// The intersection of two boxes: none, one, or two boxes. Two if each end of one overlaps the other, as boxes that
// reach around most of the Earth may.
std::vector<GeoBounds> CommonBounds(const GeoBounds& a, const GeoBounds& b);

// The properties of a raster that decide which tiles exist.
struct PlannedRaster {
  GeoBounds bounds;
  double east_step_m = 0, north_step_m = 0;  // on the ground, between samples
};

// ElevationModel::Availability of a dataset of these rasters. Precondition: not empty.
std::vector<std::vector<geo::TileRange>> PlannedTiles(std::span<const PlannedRaster> rasters, double error_fraction);

}  // namespace terrace::dem
