// Rows of positions, with SIMD: interpolation between knots, outermost coordinates, positions in a box. Results are
// bit-equal on all instruction sets.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "engine/crs/projector.h"

namespace terrace::dem {

// Knots along an axis of a cell of nodes.
inline constexpr int kKnots = 5;

// The outermost coordinates of positions that are known; infinite, with `min` above `max`, if there is none.
struct PositionExtent {
  Position min{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Position max{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  bool are_all_known = true;

  void Add(const PositionExtent& other) {
    min = {std::min(min.x, other.min.x), std::min(min.y, other.min.y)};
    max = {std::max(max.x, other.max.x), std::max(max.y, other.max.y)};
    are_all_known &= other.are_all_known;
  }
};
PositionExtent ExtentOf(std::span<const Position> positions);

// Adds up the products of each knot and its weights: one sum for each of `positions`. `weights`: one pointer a knot, to
// as many weights as there are positions. Returns the extent of the positions. Precondition: all knots are known.
PositionExtent InterpolatePositions(const std::array<Position, kKnots>& knots,
                                    const std::array<const double*, kKnots>& weights, std::span<Position> positions);

// Sets the elements of positions in the box from `min` to `max`, ends included, to 1, and leaves the others.
void MarkInside(std::span<const Position> positions, const Position& min, const Position& max,
                std::span<std::uint8_t> inside);

}  // namespace terrace::dem
