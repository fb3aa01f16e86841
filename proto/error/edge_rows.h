// Finds the lattice nodes in a triangle, row by row.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace terrace::proto {

// Coordinates in which vertices and lattice nodes are integers. The unit for quantized tiles is 1 / (32767 * cells) of
// the tile; u * cells and i * 32767 stay below 2^23, products of two below 2^46. For a mesh on the lattice it is a
// cell.
struct NodePoint {
  std::int64_t x = 0, y = 0;

  friend bool operator==(const NodePoint&, const NodePoint&) = default;
};

// Positive for counter-clockwise triangles.
inline std::int64_t TwiceArea(const std::array<NodePoint, 3>& p) {
  return (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
}

// Where an edge a -> b crosses the rows of nodes. The nodes of row y on the edge or to its left satisfy
//   (b - a) x (p - a) >= 0, that is dx (y - a.y) - dy (x - a.x) >= 0.
class EdgeRows {
 public:
  EdgeRows() = default;
  // `unit`: distance between lattice nodes.
  EdgeRows(NodePoint a, NodePoint b, std::int64_t unit)
      : dx_(b.x - a.x), dy_(b.y - a.y), at_zero_(dy_ * a.x - dx_ * a.y), inverse_(InverseOf(std::abs(dy_) * unit)) {}

  // Narrows the columns [first, last] to those on the edge or to its left. The row is between the triangle's corners.
  void Clip(std::int64_t y, std::int64_t& first, std::int64_t& last) const {
    if (dy_ > 0) last = std::min(last, Floor(y));
    if (dy_ < 0) first = std::max(first, -Floor(y));
  }

  // The displacement for ClipMoved if the edge is moved by at most `x` and `y` along the axes. Negative values displace
  // it to its left.
  double Move(double x, double y) const {
    return std::abs(static_cast<double>(dx_)) * y + std::abs(static_cast<double>(dy_)) * x;
  }

  // Clip for the edge moved by Move. Accepts any row. Not exact to the last bit.
  void ClipMoved(std::int64_t y, double move, std::int64_t& first, std::int64_t& last) const {
    const double n = static_cast<double>(dx_ * y + at_zero_) + move;
    if (dy_ > 0) last = std::min(last, FloorOf(n * inverse_));
    if (dy_ < 0) first = std::max(first, -FloorOf(n * inverse_));
    if (dy_ == 0 && n < 0) last = first - 1;
  }

 private:
  static double InverseOf(std::int64_t d) { return d == 0 ? 0 : 1 / static_cast<double>(d); }

  // The floor of n / d with n = dx y + dy a.x - dx a.y and d = |dy| unit, exact with one multiplication. n is exact as
  // a double and the quotient is below 2^9 in magnitude, so the error of n * (1 / d) is less than 2^-42. A quotient
  // that is not an integer is at least 1 / d > 2^-39 below the next integer. Adding 2^-41 therefore corrects an integer
  // that was rounded down, and moves no other quotient past an integer.
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
