// The largest error of a row of samples, and the extent of samples, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <cstddef>
#include <span>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

struct HeightExtent {
  float lowest = 0, highest = 0;
};
// Precondition: not empty.
HeightExtent ExtentOf(std::span<const float> heights);

// Heights along a row of nodes, linear in longitude and latitude: origin + slope (x + unit i) + rise, in that order.
// `rise`: what the row's latitude adds, metres.
struct LinearRow {
  double origin = 0, slope = 0, x = 0, unit = 1, rise = 0;
};

// The largest difference from `count` samples.
double LargestOfLinearRow(const LinearRow& row, const float* samples, std::size_t count);

// Heights along a row of nodes where their plumb lines meet the plane dot(normal, point) = offset. A node at longitude
// l has the height (rest - radius * across) / (cos * across + north), across = x * cos(l) + y * sin(l). For a latitude
// b, whose point on the ellipsoid is `radius` metres from the axis and z metres from the equator's plane: x = normal.x,
// y = normal.y, cos = cos(b), north = sin(b) * normal.z, rest = offset - z * normal.z.
struct PlumbRow {
  double x = 0, y = 0, cos = 0, north = 0, rest = 0, radius = 0;
};

// The largest difference from `count` samples, metres; nodes without a height (NaN) do not count. `min_up`: becomes the
// smallest |cos * across + north|; if it is too small for the plane, the result has no meaning.
double LargestOfPlumbRow(const PlumbRow& row, const geo::SinCos* columns, const float* samples, std::size_t count,
                         double& min_up);

}  // namespace terrace::proto
