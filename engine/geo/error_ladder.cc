#include "engine/geo/error_ladder.h"

#include <array>
#include <cmath>
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

}  // namespace terrace::geo
