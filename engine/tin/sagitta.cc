#include "engine/tin/sagitta.h"

#include <algorithm>

namespace terrace::tin {

double SagittaBound(const Curvature& curvature, const std::array<Corner, 3>& corners) {
  if (curvature.east_m2.empty()) return 0;
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const auto& [a, b, c] = sorted;
  const double east_m2 = *std::max_element(curvature.east_m2.begin() + a.y, curvature.east_m2.begin() + c.y + 1);
  const auto squared_length = [&](const Corner& p, const Corner& q) {
    const double dx = q.x - p.x, dy = q.y - p.y;
    return dx * dx * east_m2 + dy * dy * curvature.north_m2;
  };
  const double ab = squared_length(a, b), bc = squared_length(b, c), ca = squared_length(c, a);
  const double longest = std::max({ab, bc, ca});
  if (longest >= ab + bc + ca - longest) return longest / 4 / (2 * curvature.radius_m);

  // R = |ab| |bc| |ca| / (4 area).
  const double doubled_area = Plane(sorted).doubled_area;
  const double area_16 = 4 * doubled_area * doubled_area * east_m2 * curvature.north_m2;  // 16 area^2
  return ab * bc * ca / area_16 / (2 * curvature.radius_m);
}

}  // namespace terrace::tin
