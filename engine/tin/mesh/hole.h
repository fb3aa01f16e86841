// The hole that an inner vertex leaves: a polygon that sees the vertex from every side, and the fans that can fill it.
//
// A fan has an apex among the corners of the hole and joins it to all others: apex, apex + i + 1, apex + i + 2 is its
// triangle i, cyclic. Once all of them turn counter-clockwise, they cover the hole exactly once: their signed areas add
// up to its winding number, which is one inside.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/tin/mesh/plane.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class Hole {
 public:
  // Larger holes are left alone: about six sides are usual, and the fans of a hole take the square of its sides to try.
  // Not critical: with 16 or 64 instead, two of the paper's DEMs end within one vertex of the same count at 1, 5 and
  // 20 m.
  static constexpr std::size_t kMaxSides = 32;

  // `height` is the vertex's sample, NaN where that is void. Then the corners, counter-clockwise, at most kMaxSides.
  void Begin(SamplePosition vertex, double height) {
    vertex_ = vertex;
    height_ = height;
    sides_ = 0;
  }
  void AddCorner(SamplePosition position, double height) {
    positions_[sides_] = position;
    heights_[sides_] = height;
    ++sides_;
  }

  std::size_t triangle_count() const { return sides_ - 2; }  // of every fan

  std::array<std::size_t, 3> Triangle(std::size_t apex, std::size_t i) const {
    return {apex, Wrap(apex + i + 1), Wrap(apex + i + 2)};
  }
  Corner corner(std::size_t i) const { return {positions_[i].x, positions_[i].y, heights_[i]}; }
  SamplePosition position(std::size_t i) const { return positions_[i]; }

  // The apexes of all different fans that turn counter-clockwise and are at most `max_error` off at the vertex, nearest
  // there first, ties to the earlier apex. Valid until the next call.
  std::span<const std::size_t> Fans(double max_error);

 private:
  std::size_t Wrap(std::size_t i) const { return i < sides_ ? i : i - sides_; }
  bool IsCounterClockwise(std::size_t apex) const;
  double ErrorAtVertex(std::size_t apex) const;

  SamplePosition vertex_;
  double height_ = 0;
  std::size_t sides_ = 0;
  std::array<SamplePosition, kMaxSides> positions_;
  std::array<double, kMaxSides> heights_;
  std::array<std::size_t, kMaxSides> apexes_;
};

}  // namespace terrace::tin
