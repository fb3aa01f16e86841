// Exact geometric predicates on sample positions, in 64-bit integers. No rounding, no tolerance, the same on every CPU.
//
// Let S = 2^15 = HeightField::kMaxSide. All coordinates are in [0, S), so all points lie in a square of side S - 1.
//
// Laws, which are the test cases:
//   1. Orientation(a, b, c) is twice the signed area of abc: positive when abc turns counter-clockwise.
//   2. It changes its sign when two arguments are exchanged and keeps it when they are rotated.
//   3. InCircle(a, b, c, d) of a counter-clockwise abc is positive when d lies strictly inside the circle through a, b
//      and c, zero on it, negative outside; it keeps its sign when a, b, c are rotated.
//   4. Neither overflows, up to the corners of a field of kMaxSide x kMaxSide samples.
#pragma once

#include <cstdint>

#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// Width: each product is below S^2 = 2^30 in magnitude.
constexpr std::int64_t Orientation(SamplePosition a, SamplePosition b, SamplePosition c) {
  const std::int64_t abx = b.x - a.x, aby = b.y - a.y;
  const std::int64_t acx = c.x - a.x, acy = c.y - a.y;
  return abx * acy - aby * acx;
}

// Width: relative to d, each squared length is below 2 S^2. Each 2 x 2 determinant is twice the area of a triangle
// inside a square of side S - 1, hence below S^2. So each of the three terms is below 2 S^4 and every partial sum below
// 6 S^4 = 6 * 2^60 < 2^63.
constexpr std::int64_t InCircle(SamplePosition a, SamplePosition b, SamplePosition c, SamplePosition d) {
  const std::int64_t ax = a.x - d.x, ay = a.y - d.y;
  const std::int64_t bx = b.x - d.x, by = b.y - d.y;
  const std::int64_t cx = c.x - d.x, cy = c.y - d.y;
  return (ax * ax + ay * ay) * (bx * cy - by * cx) + (bx * bx + by * by) * (cx * ay - cy * ax) +
         (cx * cx + cy * cy) * (ax * by - ay * bx);
}

}  // namespace terrace::tin
