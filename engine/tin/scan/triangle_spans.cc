#include "engine/tin/scan/triangle_spans.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/mesh/star.h"

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

// Everything is multiplied by the doubled area, so there is no division. If heights are multiples of a common power of
// two and fit into 53 bits together with the squared extent, the test is exact even for thin triangles.
bool SamplesAreWithin(const HeightField& field, const std::array<Corner, 3>& corners, double bound) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Corner &a = sorted[0], &b = sorted[1], &c = sorted[2];
  const double dx_b = b.x - a.x, dy_b = b.y - a.y, dz_b = b.z - a.z;
  const double dx_c = c.x - a.x, dy_c = c.y - a.y, dz_c = c.z - a.z;
  const double doubled_area = dx_b * dy_c - dx_c * dy_b;  // negative when the sorted corners turn clockwise
  const double per_column = dz_b * dy_c - dz_c * dy_b, per_row = dx_b * dz_c - dx_c * dz_b;
  const double largest = bound * std::abs(doubled_area);
  bool within = true;
  ForEachInnerSpan(sorted, doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    if (!within) return;
    const float* row = field.Row(y);
    const double at_row = per_row * (y - a.y);
    bool misses = false;
    for (int x = first; x <= last; ++x) {
      const double distance = at_row + per_column * (x - a.x) - doubled_area * (static_cast<double>(row[x]) - a.z);
      misses |= std::abs(distance) > largest;  // false for voids
    }
    within = !misses;
  });
  return within;
}

std::uint32_t FirstSample(const HeightField& field, const Star& star, std::size_t i) {
  const auto corner = [&](const RingVertex& vertex) -> Corner { return {star.x + vertex.dx, star.y + vertex.dy, 0}; };
  const std::array<Corner, 3> sorted = SortedByRow({corner(star.ring[i]), corner(star.ring[i + 1]), corner({})});
  std::uint32_t found = kNoSample;
  ForEachInnerSpan(sorted, Plane(sorted).doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    if (found != kNoSample) return;
    const float* const row = field.Row(y);
    while (first <= last && std::isnan(row[first])) ++first;
    if (first <= last) found = SampleNumber(first, y);
  });
  return found;
}

}  // namespace terrace::tin
