// Which lattice nodes lie in a triangle, row by row.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace terrace::proto {

// Coordinates in which both the vertices and the lattice nodes are integers. Of quantized tiles: 1 / (32767 * cells) of
// the tile; u * cells and i * 32767 stay below 2^23, products of two below 2^46. Of a mesh on the lattice: its cells.
struct NodePoint {
  std::int64_t x = 0, y = 0;

  friend bool operator==(const NodePoint&, const NodePoint&) = default;
};

// Positive for counter-clockwise triangles.
inline std::int64_t TwiceArea(const std::array<NodePoint, 3>& p) {
  return (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
}

// Where an edge a -> b crosses the rows of nodes: the nodes of row y on its left or on it are those with
//   (b - a) x (p - a) >= 0, that is dx (y - a.y) - dy (x - a.x) >= 0.
class EdgeRows {
 public:
  EdgeRows() = default;
  // `unit`: from one lattice node to the next.
  EdgeRows(NodePoint a, NodePoint b, std::int64_t unit)
      : dx_(b.x - a.x), dy_(b.y - a.y), at_zero_(dy_ * a.x - dx_ * a.y), inverse_(InverseOf(std::abs(dy_) * unit)) {}

  // Narrows the columns [first, last] of a row between the triangle's lowest and highest.
  void Clip(std::int64_t y, std::int64_t& first, std::int64_t& last) const {
    if (dy_ > 0) last = std::min(last, Floor(y));
    if (dy_ < 0) first = std::max(first, -Floor(y));
  }

  // By which an edge lies further to its right if it is moved by `x` and `y` along the axes; negative: to its left.
  double Move(double x, double y) const {
    return std::abs(static_cast<double>(dx_)) * y + std::abs(static_cast<double>(dy_)) * x;
  }

  // Clip for the edge moved by Move. Of any row; not to the last bit.
  void ClipMoved(std::int64_t y, double move, std::int64_t& first, std::int64_t& last) const {
    const double n = static_cast<double>(dx_ * y + at_zero_) + move;
    if (dy_ > 0) last = std::min(last, FloorOf(n * inverse_));
    if (dy_ < 0) first = std::max(first, -FloorOf(n * inverse_));
    if (dy_ == 0 && n < 0) last = first - 1;
  }

 private:
  static double InverseOf(std::int64_t d) { return d == 0 ? 0 : 1 / static_cast<double>(d); }

  // Of n = dx y + dy a.x - dx a.y over d = |dy| unit, exact with one multiplication: n is a double without rounding,
  // the quotient is below 2^9 in magnitude, so n * (1 / d) is off by less than 2^-42; one that is no integer lies at
  // least 1 / d > 2^-39 below the next. Adding 2^-41 lifts an integer that was rounded down above itself, and lifts
  // nothing else over an integer.
  std::int64_t Floor(std::int64_t y) const {
    return FloorOf(static_cast<double>(dx_ * y + at_zero_) * inverse_ + 0x1p-41);
  }

  static std::int64_t FloorOf(double quotient) {
    const auto towards_zero = static_cast<std::int64_t>(quotient);
    return towards_zero - (static_cast<double>(towards_zero) > quotient ? 1 : 0);
  }

  std::int64_t dx_ = 0, dy_ = 0, at_zero_ = 0;
  double inverse_ = 0;
};

}  // namespace terrace::proto
