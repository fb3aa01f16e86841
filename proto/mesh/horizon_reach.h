// The distance of the horizon point of a tile's positions from the Earth's centre, in scaled space, with SIMD. Results
// are bit-equal on all instruction sets.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

// Positions (ECEF, metres) are divided by the radii of the ellipsoid less `shrink_m`. The tangent from a position p to
// the unit sphere meets the ray along `direction` (a unit vector in scaled space) at H. The reach of p is |H|; it is
// not positive if they do not meet. With a the angle between p and the direction, and b the angle from p to where the
// tangent touches:
//
//            H        |H| = 1 / cos(a + b)
//           /|\       cos b = 1 / |p|; |p| counts as at least 1: positions inside the sphere count as on it
//         p/ | \      .
//         /a |  \     .
//     b_/.---+---.\_
//
// Raises `reach` to the largest of all positions. False: one of them is not in (0, max_reach], or is NaN; `reach` is
// then unspecified.
bool RaiseReach(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double shrink_m, double max_reach,
                double& reach);

}  // namespace terrace::proto
