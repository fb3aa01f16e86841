// Points along the shortest lines on the ellipsoid (geodesics) between given positions.
#pragma once

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/common/dem_types.h"

namespace terrace::dem {

struct PathPoint {
  GeoPosition position;
  double distance_m = 0;  // from the path's beginning, along the ellipsoid
};

// Immutable and thread-safe. Rounds positions to 1e-9 degrees (0.1 mm) and distances to 1 mm, because the last bits of
// geodesic computations differ between machines.
class GeodesicPath {
 public:
  // If a stop is requested, the length is wrong and there are no points.
  // Precondition: at least two corners, latitudes in -90 .. 90, longitudes finite.
  explicit GeodesicPath(std::vector<GeoPosition> corners, std::stop_token stop = {});

  double length_m() const { return ends_m_.back(); }

  // Returns `count` equidistant points, including the first and the last corner. Other corners are generally not among
  // them. Precondition: count >= 2.
  std::vector<PathPoint> Divide(std::size_t count) const;

  // Returns points every `step_m` metres from the first corner on, and the last corner. Precondition: step_m > 0 and
  // StepCount(step_m) points fit into memory.
  std::vector<PathPoint> Walk(double step_m) const;

  // Returns the number of points of Walk. A double, because it can exceed every integer type.
  double StepCount(double step_m) const;

 private:
  std::vector<PathPoint> At(std::span<const double> distances) const;  // ascending

  std::vector<GeoPosition> corners_;
  std::stop_token stop_;
  std::vector<double> ends_m_;  // distance of each corner
};

}  // namespace terrace::dem
