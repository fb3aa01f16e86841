// The part of the globe a raster covers, and the tiles that touch it.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/dem_types.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Degrees. `west` lies in -180 .. 180, `east` east of it, up to west + 360: boxes that cross the antimeridian have east
// > 180.
struct Footprint {
  double west = -180, south = -90, east = 180, north = 90;

  // Of the pixels' area. Where positions of the raster's edge cannot be computed: the whole Earth.
  static Footprint Of(const Georeference& georeference);

  bool all_longitudes() const { return east - west >= 360; }
  GeoBounds Bounds() const;

  // A little larger on every side: what lies outside this box lies outside the raster, whatever the curvature of its
  // edges.
  Footprint Padded() const;

  // Of a box in degrees.
  static Footprint Of(const GeoBounds& bounds);

  bool Touches(const Footprint& other) const;

  // Whether it touches the box from (west, south), `width` by `height` degrees large; west counts modulo 360.
  bool Touches(double box_west, double box_south, double box_width, double box_height) const;
};

// kInvalidArgument, with both boxes, where `path`, which covers `footprint`, lies nowhere in `around`.
Result<void> CheckOverlap(const Footprint& footprint, const GeoBounds& around, const std::string& path);

// The tiles of a level that the footprint touches, as one block or two: a tile that shares but an edge is not touched.
std::vector<geo::TileRange> TilesTouching(const Footprint& footprint, int level);

}  // namespace terrace::dem
