// The geometric errors that tiles of each level have.
//
// Clients assume a level error of 77,067.34 m / 2^level for EPSG:4326 terrain (CesiumJS TerrainProvider,
// getEstimatedLevelZeroGeometricErrorForAHeightmap: radius * 2 pi * 0.25 / (65 samples * 2 tiles of level 0)). The
// default error of a level is a fraction (0.5) of it. The errors that tiles of a level may have are 41 steps, the
// ladder: from 16 times the default error down to a 64th of it, each 2^(1/4) times the next. A requested error is
// rounded down to a step; if it is below the finest step, it becomes that step.
#pragma once

#include <optional>
#include <span>

#include "engine/geo/tile_key.h"

namespace terrace::geo {

inline constexpr int kCoarsestStep = -16;  // 16 times the default error
inline constexpr int kFinestStep = 24;     // a 64th of the default error
inline constexpr double kDefaultErrorFraction = 0.5;

// Metres: the error that clients assume for tiles of this level.
double LevelError(int level);

// Metres: the error of tiles of this level if none is requested.
double DefaultError(int level, double error_fraction = kDefaultErrorFraction);

// Metres: DefaultError * 2^(-step / 4). Precondition: kCoarsestStep <= step <= kFinestStep.
double LadderError(int level, int step, double error_fraction = kDefaultErrorFraction);

// Returns the step with the largest error that is at most `error_m`; the finest step if all steps are larger. Errors
// within one part in 10^9 of a step count as that step, so that a printed error returns its step. Precondition: error_m
// > 0, finite.
int SnapToLadder(int level, double error_m, double error_fraction = kDefaultErrorFraction);

// The error that a client or a bake requests. At most one of error_m and fraction is set; none: the step of
// ErrorScale::default_steps.
struct RequestedError {
  std::optional<double> error_m;   // finite, > 0
  std::optional<double> fraction;  // of LevelError, the error that clients assume for the level; finite, > 0
  // With error_m, on levels less than ErrorScale::max_source_level: the larger of error_m and DefaultError is
  // requested.
  bool at_least = false;
};

// What the step for a request depends on besides the request: a dataset's values.
struct ErrorScale {
  double fraction = kDefaultErrorFraction;  // ratio of a level's default error to LevelError
  // The deepest level of the sources; edits may add deeper ones.
  int max_source_level = kMaxLevel;
  // By level: the step if no error is requested. Levels without an element have step 0.
  std::span<const int> default_steps = {};
};

// Returns the step for a requested error.
int ErrorStep(const RequestedError& requested, int level, const ErrorScale& scale);

}  // namespace terrace::geo
