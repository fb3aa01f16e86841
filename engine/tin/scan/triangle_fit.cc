#include "engine/tin/scan/triangle_fit.h"

#include <cmath>

#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {

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

}  // namespace terrace::tin
