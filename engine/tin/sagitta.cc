#include "engine/tin/sagitta.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/mesh/predicates.h"

namespace terrace::tin {

Sagitta::Sagitta(Curvature curvature, int rows)
    : east_m2_(std::move(curvature.east_m2)), north_m2_(curvature.north_m2), doubled_radius_(2 * curvature.radius_m) {
  if (is_flat()) return;
  TERRACE_CHECK(east_m2_.size() == static_cast<std::size_t>(rows));
  TERRACE_CHECK(north_m2_ > 0 && doubled_radius_ > 0);
  const auto widest = std::max_element(east_m2_.begin(), east_m2_.end());
  TERRACE_CHECK(std::is_sorted(east_m2_.begin(), widest) &&
                std::is_sorted(east_m2_.rbegin(), std::reverse_iterator(widest)));
  widest_row_ = static_cast<int>(widest - east_m2_.begin());
}

double Sagitta::Bound(SamplePosition a, SamplePosition b, SamplePosition c) const {
  if (is_flat()) return 0;
  const auto [south, north] = std::minmax({int{a.y}, int{b.y}, int{c.y}});
  const double east_m2 = east_m2_[static_cast<std::size_t>(std::clamp(widest_row_, south, north))];
  const auto squared_length = [&](SamplePosition p, SamplePosition q) {
    const double dx = q.x - p.x, dy = q.y - p.y;
    return dx * dx * east_m2 + dy * dy * north_m2_;
  };
  const double ab = squared_length(a, b), bc = squared_length(b, c), ca = squared_length(c, a);
  const double longest = std::max({ab, bc, ca});
  if (longest >= ab + bc + ca - longest) return longest / 4 / doubled_radius_;

  // R = |ab| |bc| |ca| / (4 area).
  const auto doubled_area = static_cast<double>(Orientation(a, b, c));
  const double area_16 = 4 * doubled_area * doubled_area * east_m2 * north_m2_;  // 16 area^2
  return ab * bc * ca / area_16 / doubled_radius_;
}

}  // namespace terrace::tin
