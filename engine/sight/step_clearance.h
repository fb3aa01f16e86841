// The clearance of a short step of a ray above the samples of a block.
#pragma once

#include <algorithm>
#include <cstdint>

namespace terrace::dem {

// The samples of a block, cells among them without voids, and places of a ray over them.
struct SampleView {
  const float* heights;
  std::int64_t stride, west, north, east, south;

  std::int64_t ColumnOf(double x) const { return std::clamp(static_cast<std::int64_t>(x), west, east); }
  std::int64_t RowOf(double y) const { return std::clamp(static_cast<std::int64_t>(y), north, south); }
};

struct RayPlace {
  double x, y;  // samples from the block's first
  double height_m;
};

// A lower bound of the clearance along a straight step of less than a sample. In a cell the clearance is a polynomial,
// a t^2 + b t + c for t = 0 .. 1, which lies nowhere more than |a| / 4 below both of its ends; a is the cell's twist
// times the way on both axes. The surface has no steps between cells, so each place is read in one of the two.
double LeastClearance(const SampleView& samples, const RayPlace& from, const RayPlace& to);

}  // namespace terrace::dem
