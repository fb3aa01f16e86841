// The part of the globe a raster covers, and the tiles that touch it.
#pragma once

#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/crs/georeference.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Degrees. `west` lies in -180 .. 180, `east` east of it, up to west + 360: boxes that cross the antimeridian have east
// > 180.
struct Footprint {
  double west = -180, south = -90, east = 180, north = 90;

  // Returns the footprint of the raster's pixel area; the whole Earth if a position on its edge cannot be computed.
  static Footprint Of(const Georeference& georeference);

  bool all_longitudes() const { return east - west >= 360; }
  GeoBounds Bounds() const;

  // Returns the footprint grown by 1% plus 1e-6 degrees on every side. It contains the raster although edges between
  // the sampled points are curved.
  Footprint Padded() const;

  // Converts a box in degrees; west > east crosses the antimeridian.
  static Footprint Of(const GeoBounds& bounds);

  bool Touches(const Footprint& other) const;

  // Returns true if it meets or touches the box with south-western corner (box_west, box_south), `box_width` by
  // `box_height` degrees; box_west modulo 360.
  bool Touches(double box_west, double box_south, double box_width, double box_height) const;
};

// Checks that `path`, which covers `footprint`, meets `around`. kInvalidArgument: it does not; the message has both
// boxes.
Result<void> CheckOverlap(const Footprint& footprint, const GeoBounds& around, const std::string& path);

// Returns the tiles of a level that overlap the footprint, as one range, or two across the antimeridian. Tiles that
// share only an edge with it do not overlap it.
std::vector<geo::TileRange> TilesOverlapping(const Footprint& footprint, int level);

// Whether a position on the edge of the raster cannot be computed.
bool HasUnknownOutline(const Georeference& georeference);

}  // namespace terrace::dem
