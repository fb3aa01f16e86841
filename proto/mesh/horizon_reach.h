// How far above the ellipsoid the horizon of a tile's positions is, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

// How far along `direction` (unit, scaled space) the tangent from a position to the unit sphere meets it; not positive
// where it does not. Positions (ECEF) are scaled by the radii of the ellipsoid less `shrink_m`. With a the angle
// between a position p and the direction, and b the angle from p to where the tangent touches:
//
//            H        |H| = 1 / cos(a + b)
//           /|\       cos b = 1 / |p|, at least one: positions inside the sphere count as on it
//         p/ | \      .
//         /a |  \     .
//     b_/.---+---.\_
//
// Raises `reach` to the largest of all positions. False: one of them is not in (0, max_reach], or is NaN.
bool RaiseReach(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double shrink_m, double max_reach,
                double& reach);

}  // namespace terrace::proto
