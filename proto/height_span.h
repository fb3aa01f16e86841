// The vertical extent of tiles, for bounding volumes.
#pragma once

#include <algorithm>

namespace terrace::proto {

// Heights above the ellipsoid, in metres, that contain all vertices, including the lower edges of skirts.
struct HeightSpan {
  double min_m = 0, max_m = 0;

  void Add(const HeightSpan& other) {
    min_m = std::min(min_m, other.min_m);
    max_m = std::max(max_m, other.max_m);
  }
  friend bool operator==(const HeightSpan&, const HeightSpan&) = default;
};

}  // namespace terrace::proto
