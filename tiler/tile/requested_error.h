// The geometric error that a client or a bake requests, and the step of the ladder that serves it at a level.
#pragma once

#include <optional>
#include <span>

#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {

// At most one of error_m and fraction is set.
struct RequestedError {
  std::optional<double> error_m;   // finite, > 0
  std::optional<double> fraction;  // of geo::LevelError, the error that clients assume for the level; finite, > 0
  // With error_m: on levels shallower than max_source_level, the larger of error_m and geo::DefaultError is requested.
  bool at_least = false;
};

// What a dataset's steps depend on besides the request.
struct ErrorScale {
  double fraction = geo::kDefaultErrorFraction;  // ratio of a level's default error to geo::LevelError
  // The deepest level of the sources; edits may add deeper ones. RequestedError::at_least has no effect on this level
  // and deeper ones, whose tiles have all detail of the sources.
  int max_source_level = geo::kMaxLevel;
  // The step of each level if no error is requested; 0 for levels beyond its end. A view.
  std::span<const int> default_steps = {};
};

// Returns the step of the level's ladder for a requested error.
int ErrorStep(const RequestedError& requested, int level, const ErrorScale& scale);

}  // namespace terrace::tiler
