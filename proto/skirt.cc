#include "proto/skirt.h"

#include <algorithm>
#include <cmath>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

double SkirtDepth(int level, double error_m) {
  constexpr double kSmallestRadius = geo::kSemiMinorAxis * geo::kSemiMinorAxis / geo::kSemiMajorAxis;
  const double edge = std::ldexp(geo::kSemiMajorAxis * geo::ToRadians(180), -level);
  // A chord over the whole edge; but an edge's error counts what its chords cut off, so that none cuts off more.
  const double sagitta = std::min(edge * edge / (8 * kSmallestRadius), error_m);
  return error_m + 2 * error_m + sagitta;
}

}  // namespace terrace::proto
