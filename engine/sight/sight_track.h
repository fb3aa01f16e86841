// The course of a ray over the ground and over the samples of a raster grid.
#pragma once

#include <span>
#include <vector>

#include "engine/crs/georeference.h"
#include "engine/sight/sight_ray.h"

namespace terrace::dem {

// A polynomial of the second degree through its values at 0, 0.5 and 1.
class Quadratic {
 public:
  Quadratic() = default;
  Quadratic(double first, double middle, double last)
      : a_(2 * (first + last) - 4 * middle), b_(last - first - a_), c_(first) {}

  double At(double s) const { return (a_ * s + b_) * s + c_; }
  double Slope(double s) const { return 2 * a_ * s + b_; }
  double curvature() const { return a_; }

  struct Range {
    double min, max;
  };
  Range Over(double first, double last) const;
  // The same polynomial from `first` to `last`, which become 0 and 1.
  Quadratic Part(double first, double last) const { return {At(first), At((first + last) / 2), At(last)}; }
  // The place between `first` and `last` with this value, clamped: two steps of Newton, for nearly linear ranges.
  double Solve(double value, double first, double last) const;

 private:
  double a_ = 0, b_ = 0, c_ = 0;
};

// At most kMaxLength of a ray. Within it, positions are within a millimetre of polynomials of the second degree.
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
