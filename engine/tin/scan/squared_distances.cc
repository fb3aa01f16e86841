#include "engine/tin/scan/squared_distances.h"

#include <cmath>
#include <cstdint>

#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {
namespace {

// Twice the signed area of (a, b, (x, y)); 0 on the line through a and b.
std::int64_t SideOf(const Corner& a, const Corner& b, int x, int y) {
  return static_cast<std::int64_t>(b.x - a.x) * (y - a.y) - static_cast<std::int64_t>(b.y - a.y) * (x - a.x);
}

}  // namespace

double SquaredDistances(const HeightField& field, const std::array<Corner, 3>& corners) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Corner &a = sorted[0], &b = sorted[1], &c = sorted[2];
  const Plane plane(sorted);
  double sum = 0;
  ForEachInnerSpan(sorted, plane.doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    const float* row = field.Row(y);
    const double at_row = plane.AtRow(y);
    for (int x = first; x <= last; ++x) {
      const double distance = plane.At(x, at_row) - static_cast<double>(row[x]);
      if (std::isnan(distance)) continue;
      const bool on_edge = SideOf(a, b, x, y) == 0 || SideOf(b, c, x, y) == 0 || SideOf(c, a, x, y) == 0;
      sum += (on_edge ? 0.5 : 1.0) * distance * distance;
    }
  });
  return sum;
}

}  // namespace terrace::tin
