#include "engine/tin/scan/first_sample.h"

#include <array>
#include <cmath>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {

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
