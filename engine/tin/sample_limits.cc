#include "engine/tin/sample_limits.h"

#include <array>
#include <cmath>

#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {

BoundingBox BoxOfLimits(const SampleLimits& limits, int width, int height) {
  BoundingBox box;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t k = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const bool is_forced = !limits.forced.empty() && limits.forced[k] != 0;
      if (is_forced || limits.HasLimit(k)) box.Add(x, y);
    }
  }
  return box;
}

// Samples are visited in the order of their numbers, so the first of equals is kept.
Candidate WorstLimited(const HeightField& field, const std::array<Corner, 3>& corners, double sagitta_m,
                       const SampleLimits& limits, double scale) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Plane plane(sorted);
  Candidate worst;
  ForEachInnerSpan(sorted, plane.doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    const float* const row = field.Row(y);
    const double at_row = plane.AtRow(y);
    const std::size_t begin = static_cast<std::size_t>(y) * static_cast<std::size_t>(field.width());
    for (int x = first; x <= last; ++x) {
      const double distance = std::abs(plane.At(x, at_row) - static_cast<double>(row[x]));
      if (std::isnan(distance)) continue;
      const double error = limits.WeightedError(begin + static_cast<std::size_t>(x), distance + sagitta_m, scale);
      if (error > worst.error) worst = {error, SampleNumber(x, y)};
    }
  });
  return worst;
}

bool SamplesAreAllowed(const HeightField& field, const std::array<Corner, 3>& corners, double sagitta_m,
                       const SampleLimits& limits, double max_error) {
  const std::array<Corner, 3> sorted = SortedByRow(corners);
  const Plane plane(sorted);
  bool allowed = true;
  ForEachInnerSpan(sorted, plane.doubled_area, field.width(), field.height(), [&](int y, int first, int last) {
    const float* const row = field.Row(y);
    const double at_row = plane.AtRow(y);
    const std::size_t begin = static_cast<std::size_t>(y) * static_cast<std::size_t>(field.width());
    for (int x = first; x <= last && allowed; ++x) {
      const double distance = std::abs(plane.At(x, at_row) - static_cast<double>(row[x]));
      allowed = !(distance + sagitta_m > limits.Allowed(begin + static_cast<std::size_t>(x), max_error));
    }
  });
  return allowed;
}

}  // namespace terrace::tin
