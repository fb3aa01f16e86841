// The samples of a triangle, row by row: exact integer coverage, edges and corners included.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

constexpr std::int64_t FloorDivide(std::int64_t n, std::int64_t d) {
  return n / d - (n % d != 0 && (n < 0) != (d < 0) ? 1 : 0);
}
constexpr std::int64_t CeilDivide(std::int64_t n, std::int64_t d) { return -FloorDivide(-n, d); }

// Calls visit(y, first, last) for each row of a counter-clockwise triangle, ascending, with the first and last column
// inside it. first > last if the row has none. A sample on an edge is visited for both triangles. In rows of corners,
// the corners are the first or the last column.
//
// Each edge p -> q allows the half-line where
//   Orientation(p, q, (x, y)) = (q.x - p.x)(y - p.y) - (q.y - p.y)(x - p.x) >= 0.
template <typename Visit>
void ForEachRow(const std::array<SamplePosition, 3>& corners, Visit&& visit) {
  const auto [west, east] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
  const auto [south, north] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
  for (int y = south; y <= north; ++y) {
    std::int64_t first = west, last = east;
    for (unsigned i = 0; i < 3; ++i) {
      const SamplePosition p = corners[i], q = corners[(i + 1) % 3];
      const std::int64_t dx = q.x - p.x, dy = q.y - p.y, n = dx * (y - p.y);
      if (dy > 0) last = std::min(last, p.x + FloorDivide(n, dy));
      if (dy < 0) first = std::max(first, p.x + CeilDivide(n, dy));
    }
    visit(y, static_cast<int>(first), static_cast<int>(last));
  }
}

}  // namespace terrace::tin
