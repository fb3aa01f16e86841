#include "engine/geo/error_ladder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/check.h"
#include "engine/geo/ellipsoid.h"

namespace terrace::geo {
namespace {

// 2^(-k/4) for k = 0..3 as literals, so that ladder values do not depend on libm.
constexpr std::array<double, 4> kQuarterOctave = {1.0, 0.84089641525371454, 0.70710678118654752, 0.59460355750136054};

}  // namespace

double LevelError(int level) {
  constexpr int kHeightmapWidth = 65, kRootTiles = 2;
  return std::ldexp(kSemiMajorAxis * 2 * std::numbers::pi * 0.25 / (kHeightmapWidth * kRootTiles), -level);
}

double DefaultError(int level, double error_fraction) { return error_fraction * LevelError(level); }

double LadderError(int level, int step, double error_fraction) {
  TERRACE_CHECK(step >= kCoarsestStep && step <= kFinestStep);
  const int from_coarsest = step - kCoarsestStep;
  return std::ldexp(DefaultError(level, error_fraction) * kQuarterOctave[static_cast<unsigned>(from_coarsest % 4)],
                    -from_coarsest / 4 - kCoarsestStep / 4);
}

int SnapToLadder(int level, double error_m, double error_fraction) {
  TERRACE_CHECK(std::isfinite(error_m) && error_m > 0);
  for (int step = kCoarsestStep; step < kFinestStep; ++step) {
    if (LadderError(level, step, error_fraction) <= error_m * (1 + 1e-9)) return step;
  }
  return kFinestStep;
}

int ErrorStep(const RequestedError& requested, int level, const ErrorScale& scale) {
  if (requested.fraction) {
    // The product may overflow or underflow; the ladder's ends lie far inside the range of doubles.
    const double error_m = std::clamp(*requested.fraction * LevelError(level), std::numeric_limits<double>::min(),
                                      std::numeric_limits<double>::max());
    return SnapToLadder(level, error_m, scale.fraction);
  }
  if (!requested.error_m) {
    const auto at = static_cast<std::size_t>(level);
    return at < scale.default_steps.size() ? scale.default_steps[at] : 0;
  }
  const int step = SnapToLadder(level, *requested.error_m, scale.fraction);
  // max(error, default): steps above 0 are finer than the default.
  return requested.at_least && level < scale.max_source_level ? std::min(step, 0) : step;
}

}  // namespace terrace::geo
