// The plane through three samples.
#pragma once

#include <array>
#include <utility>

namespace terrace::tin {

struct Corner {
  int x = 0;
  int y = 0;
  double z = 0;
};

// Sorts corners by row, then column. What is computed from sorted corners depends on the triangle alone, not on the
// order in which a triangulation stores its corners.
constexpr std::array<Corner, 3> SortedByRow(std::array<Corner, 3> corners) {
  const auto before = [](const Corner& a, const Corner& b) { return a.y < b.y || (a.y == b.y && a.x < b.x); };
  if (before(corners[1], corners[0])) std::swap(corners[0], corners[1]);
  if (before(corners[2], corners[1])) std::swap(corners[1], corners[2]);
  if (before(corners[1], corners[0])) std::swap(corners[0], corners[1]);
  return corners;
}

// A plane is evaluated at every sample from the same closed form, never by steps, so that rounding does not depend on
// the order of evaluation. Float heights keep the products below far from overflow (2^128 * 2^15); with integer heights
// below 2^22 all numerators are exact.
struct Plane {
  explicit constexpr Plane(const std::array<Corner, 3>& sorted) : origin(sorted[0]) {
    const double dx1 = sorted[1].x - origin.x, dy1 = sorted[1].y - origin.y, dz1 = sorted[1].z - origin.z;
    const double dx2 = sorted[2].x - origin.x, dy2 = sorted[2].y - origin.y, dz2 = sorted[2].z - origin.z;
    doubled_area = dx1 * dy2 - dx2 * dy1;  // exact; negative when the sorted corners turn clockwise
    per_column = (dz1 * dy2 - dz2 * dy1) / doubled_area;
    per_row = (dx1 * dz2 - dx2 * dz1) / doubled_area;
  }

  // The height in row y at the column of `origin`; the height at column x, where `at_row` is AtRow of its row.
  constexpr double AtRow(int y) const { return origin.z + per_row * (y - origin.y); }
  constexpr double At(int x, double at_row) const { return at_row + per_column * (x - origin.x); }

  Corner origin;
  double doubled_area = 0;
  double per_column = 0;
  double per_row = 0;
};

}  // namespace terrace::tin
