// The course of a ray over the ground and over the samples of a raster grid.
#pragma once

#include <span>
#include <vector>

#include "engine/crs/georeference.h"
#include "engine/sight/quadratic.h"
#include "engine/sight/sight_ray.h"

namespace terrace::dem {

// At most kMaxLength of a ray. Within it, positions are within a millimetre of polynomials of the second degree; within
// two metres of a pole, within half a metre.
struct TrackPiece {
  static constexpr double kMaxLength = 8000;  // metres

  double start = 0, end = 1;  // as shares of the ray
  double length_m = 0;
  Quadratic longitude, latitude;  // continuous across the antimeridian
  Quadratic height_m;             // of the ray above the ellipsoid
};

// The pieces of a ray, in order; at least one.
std::vector<TrackPiece> PiecesOf(const SightRay& ray, const SightOptions& options);

// A piece in samples: (0, 0) is the centre of the first pixel. NaN where the CRS has no such position.
struct PieceOnGrid {
  TrackPiece track;
  Quadratic x, y;
};
// In order. A piece that leaves the map at one edge and enters it at another, or that leaves the part of the Earth that
// the CRS has positions for, is divided there. Columns of a grid that wraps are continuous along the ray.
std::vector<PieceOnGrid> OnGrid(std::span<const TrackPiece> pieces, const Georeference& georeference);

}  // namespace terrace::dem
