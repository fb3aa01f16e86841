// Points along the shortest lines on the ellipsoid (geodesics) between given positions.
#pragma once

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/dem/dem_types.h"

namespace terrace::dem {

struct PathPoint {
  GeoPosition position;
  double distance_m = 0;  // from the path's beginning, along the ellipsoid
};

// Immutable and thread-safe. Positions it gives are rounded to 1e-9 degrees (0.1 mm), distances to 1 mm: the geodesics'
// last bits differ between machines.
class GeodesicPath {
 public:
  // Once a stop is requested the path is of no more use: its length is wrong, and it has no points.
  // Precondition: at least two corners, latitudes in -90 .. 90, longitudes finite.
  explicit GeodesicPath(std::vector<GeoPosition> corners, std::stop_token stop = {});

  double length_m() const { return ends_m_.back(); }

  // `count` points at equal distances, the first and the last corner included. Corners between them are passed by.
  // Precondition: count >= 2.
  std::vector<PathPoint> Divide(std::size_t count) const;

  // Points every `step_m` metres from the first corner, and the last corner. Precondition: step_m > 0 and
  // StepCount(step_m) fits the memory.
  std::vector<PathPoint> Walk(double step_m) const;

  // How many points Walk gives; a double, because a small step can make more than any integer holds.
  double StepCount(double step_m) const;

 private:
  std::vector<PathPoint> At(std::span<const double> distances) const;  // ascending

  std::vector<GeoPosition> corners_;
  std::stop_token stop_;
  std::vector<double> ends_m_;  // distance of each corner
};

}  // namespace terrace::dem
