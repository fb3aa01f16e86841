// The polygon that the removal of an inner vertex leaves, star-shaped around the vertex, and the fans of triangles that
// can fill it.
//
// A fan has an apex among the corners of the polygon and joins it to all others. Its triangle i is (apex, apex + i + 1,
// apex + i + 2), cyclic. If all triangles are counter-clockwise, they cover the polygon exactly once: their signed
// areas add up to its winding number, which is 1 inside.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "engine/tin/mesh/plane.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class RemovalPolygon {
 public:
  // Larger polygons are not filled: most have six sides, and trying all fans takes time quadratic in the
  // number of sides. The value is not critical: with 16 or 64, two of the paper's DEMs end within one vertex of the
  // same count at 1, 5 and 20 m.
  static constexpr std::size_t kMaxSides = 32;

  // `height` is the vertex's sample, NaN if it is void. Then add the corners, counter-clockwise, at most kMaxSides.
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

  // The apexes of the distinct fans that are counter-clockwise and have an error of at most `max_error` at the vertex.
  // Ordered by this error, ties by apex. Valid until the next call.
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
