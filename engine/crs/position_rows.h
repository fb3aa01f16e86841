// Rows of positions, with SIMD: interpolation between knots, and the outermost coordinates. Results are bit-equal on
// all instruction sets.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>

#include "engine/crs/projector.h"

namespace terrace::dem {

// Knots along an axis of a cell of nodes.
inline constexpr int kKnots = 5;

// Adds up the products of each knot and its weights: one sum for each of `positions`. `weights`: one pointer a knot, to
// as many weights as there are positions.
void InterpolatePositions(const std::array<Position, kKnots>& knots, const std::array<const double*, kKnots>& weights,
                          std::span<Position> positions);

// The outermost coordinates of positions that are known; infinite, with `min` above `max`, if there is none.
struct PositionExtent {
  Position min{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Position max{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  bool are_all_known = true;
};
PositionExtent ExtentOf(std::span<const Position> positions);

}  // namespace terrace::dem
