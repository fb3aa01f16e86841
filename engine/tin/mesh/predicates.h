// An exact predicate on sample positions, in 64-bit integers. No rounding, no tolerance, the same on every CPU.
//
// Let S = 2^15 = HeightField::kMaxSide. All coordinates are in [0, S), so all points lie in a square of side S - 1.
//
// Laws, which are the test cases:
//   1. Orientation(a, b, c) is twice the signed area of abc: positive when abc turns counter-clockwise.
//   2. It changes its sign when two arguments are exchanged and keeps it when they are rotated.
//   3. It does not overflow, up to the corners of a field of kMaxSide x kMaxSide samples.
#pragma once

#include <cstdint>

#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// No overflow: each product is below S^2 = 2^30 in magnitude.
constexpr std::int64_t Orientation(SamplePosition a, SamplePosition b, SamplePosition c) {
  const std::int64_t abx = b.x - a.x, aby = b.y - a.y;
  const std::int64_t acx = c.x - a.x, acy = c.y - a.y;
  return abx * acy - aby * acx;
}

}  // namespace terrace::tin
