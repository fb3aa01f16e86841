// The samples of one triangle and the heights of its plane there. Plain and slow; shares only the orientation predicate
// with the engine's scan.
#pragma once

#include <algorithm>
#include <array>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::bench {

// Calls visit(sample, height) for every sample in the closed triangle, corners included, row by row. Corners are
// counter-clockwise and have the field's VertexHeight.
template <typename Visit>
void ForEachSample(const tin::HeightField& field, const std::array<tin::SamplePosition, 3>& corners, Visit&& visit) {
  const auto [a, b, c] = corners;
  const auto height_of = [&](tin::SamplePosition p) { return static_cast<double>(field.VertexHeight(p.x, p.y)); };
  const double height_a = height_of(a), height_b = height_of(b), height_c = height_of(c);
  const auto doubled_area = static_cast<double>(Orientation(a, b, c));
  const auto [west, east] = std::minmax({a.x, b.x, c.x});
  const auto [first, last] = std::minmax({a.y, b.y, c.y});
  for (int y = first; y <= last; ++y) {
    for (int x = west; x <= east; ++x) {
      const tin::SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
      const auto of_a = Orientation(b, c, p), of_b = Orientation(c, a, p), of_c = Orientation(a, b, p);
      if (of_a < 0 || of_b < 0 || of_c < 0) continue;
      visit(p, (static_cast<double>(of_a) * height_a + static_cast<double>(of_b) * height_b +
                static_cast<double>(of_c) * height_c) /
                   doubled_area);
    }
  }
}

}  // namespace terrace::bench
