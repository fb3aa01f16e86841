#include "engine/tin/mesh/removal_polygon.h"

#include <cmath>

#include "engine/tin/mesh/predicates.h"

namespace terrace::tin {

std::span<const std::size_t> RemovalPolygon::Fans(double max_error) {
  // All fans of a triangle are equal, and opposite apexes of a quadrilateral give equal fans.
  const std::size_t different = sides_ == 3 ? 1 : sides_ == 4 ? 2 : sides_;
  std::array<double, kMaxSides> errors;
  std::size_t count = 0;
  for (std::size_t apex = 0; apex < different; ++apex) {
    if (!IsCounterClockwise(apex)) continue;
    const double error = ErrorAtVertex(apex);
    if (error > max_error) continue;
    std::size_t place = count++;
    for (; place > 0 && errors[place - 1] > error; --place) {
      errors[place] = errors[place - 1];
      apexes_[place] = apexes_[place - 1];
    }
    errors[place] = error;
    apexes_[place] = apex;
  }
  return {apexes_.data(), count};
}

bool RemovalPolygon::IsCounterClockwise(std::size_t apex) const {
  for (std::size_t i = 0; i < triangle_count(); ++i) {
    const auto [a, b, c] = Triangle(apex, i);
    if (Orientation(positions_[a], positions_[b], positions_[c]) <= 0) return false;
  }
  return true;
}

// The vertex lies in one triangle, between the spokes to b and c or on one of them.
double RemovalPolygon::ErrorAtVertex(std::size_t apex) const {
  if (std::isnan(height_)) return 0;
  std::size_t i = 0;
  while (i + 1 < triangle_count() && Orientation(positions_[apex], positions_[Wrap(apex + i + 2)], vertex_) > 0) ++i;
  const auto [a, b, c] = Triangle(apex, i);
  const SamplePosition p = positions_[a], q = positions_[b], r = positions_[c];
  const auto weight_b = static_cast<double>(Orientation(p, vertex_, r));
  const auto weight_c = static_cast<double>(Orientation(p, q, vertex_));
  const double numerator = weight_b * (heights_[b] - heights_[a]) + weight_c * (heights_[c] - heights_[a]);
  return std::abs(numerator / static_cast<double>(Orientation(p, q, r)) - (height_ - heights_[a]));
}

}  // namespace terrace::tin
