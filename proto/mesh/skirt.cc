#include "proto/mesh/skirt.h"

#include <algorithm>
#include <cmath>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"

namespace terrace::proto {

double SkirtDepth(int level, double error_m) {
  const double edge = std::ldexp(geo::kSemiMajorAxis * geo::ToRadians(180), -level);
  // The sagitta of a chord over the whole edge; but at most the error, because an edge's error includes the sagitta of
  // its chords.
  const double sagitta = std::min(edge * edge / (8 * geo::kSmallestRadius), error_m);
  return error_m + 2 * error_m + sagitta;
}

double SkirtError(int level, int step, bool is_deepest, double error_fraction) {
  return geo::LadderError(level, is_deepest ? std::min(step, 0) : step, error_fraction);
}

}  // namespace terrace::proto
