// Lines of equal height over a grid of heights, by GDAL's contour generator: marching squares with linear interpolation
// between neighbouring nodes. No GDAL type appears in this header.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

struct ContourPoint {
  double x = 0, y = 0;  // in nodes: the first node is at (0, 0)

  friend bool operator==(const ContourPoint&, const ContourPoint&) = default;
};

struct ContourLine {
  double height = 0;  // a multiple of the interval
  std::vector<ContourPoint> points;
};

// The largest number of crossings of contours and grid edges that TraceContours accepts.
inline constexpr std::size_t kMaxContourCrossings = std::size_t{1} << 20;

// The number of crossings of contours and edges of the grid: one for each point of TraceContours. `heights`: columns *
// rows, row by row; NaN: none. Precondition: interval > 0.
std::size_t CountContourCrossings(std::span<const float> heights, int columns, int rows, double interval);

// Lines at all multiples of `interval`, sorted by height; lines of one height are in a fixed order. GDAL continues
// lines half a square beyond the grid, and half way towards nodes without a height. The line inside a square depends
// only on the heights of its four nodes. A height equal to a multiple counts as above it. kCancelled: stopped.
// kInternal: GDAL failed. Precondition: at most kMaxContourCrossings.
Result<std::vector<ContourLine>> TraceContours(std::span<const float> heights, int columns, int rows, double interval,
                                               const std::stop_token& stop);

}  // namespace terrace::dem
