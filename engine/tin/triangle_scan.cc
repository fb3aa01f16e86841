#include "engine/tin/triangle_scan.h"

#include <cmath>
#include <cstdint>

#include "engine/tin/triangle_spans.h"

namespace terrace::tin {
namespace {

// Twice the signed area of (a, b, (x, y)); 0 on the line through a and b.
std::int64_t Side(const Corner& a, const Corner& b, int x, int y) {
  return static_cast<std::int64_t>(b.x - a.x) * (y - a.y) - static_cast<std::int64_t>(b.y - a.y) * (x - a.x);
}

}  // namespace

PlaneMisfit WorstSample(const HeightField& field, const std::array<Corner, 3>& corners) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Plane plane(sorted);
  PlaneMisfit worst;
  int worst_x = 0, worst_y = -1;
  // Samples come in row-major order and NaN compares false: a strict ">" settles ties and skips voids.
  ForEachInnerSpan(sorted, plane.doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    const float* row = field.Row(y);
    const double at_row = plane.AtRow(y);
    for (int x = first; x <= last; ++x) {
      const double distance = std::abs(plane.At(x, at_row) - static_cast<double>(row[x]));
      if (distance > worst.distance) {
        worst.distance = distance;
        worst_x = x;
        worst_y = y;
      }
    }
  });
  if (worst_y >= 0) {
    worst.sample = static_cast<std::uint32_t>(worst_y) * static_cast<std::uint32_t>(field.width()) +
                   static_cast<std::uint32_t>(worst_x);
  }
  return worst;
}

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
      const bool on_edge = Side(a, b, x, y) == 0 || Side(b, c, x, y) == 0 || Side(c, a, x, y) == 0;
      sum += (on_edge ? 0.5 : 1.0) * distance * distance;
    }
  });
  return sum;
}

}  // namespace terrace::tin
