// How far tiles reach up and down: what bounding volumes are made of.
#pragma once

#include <algorithm>

namespace terrace::proto {

// Metres above the ellipsoid that no vertex leaves, feet of skirts included.
struct HeightSpan {
  double min_m = 0, max_m = 0;

  void Add(const HeightSpan& other) {
    min_m = std::min(min_m, other.min_m);
    max_m = std::max(max_m, other.max_m);
  }
  friend bool operator==(const HeightSpan&, const HeightSpan&) = default;
};

}  // namespace terrace::proto
