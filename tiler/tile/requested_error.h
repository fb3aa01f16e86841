// The geometric error that a client or a bake requests, and the step of the ladder that serves it at a level.
#pragma once

#include <optional>
#include <span>

namespace terrace::tiler {

// All members are optional.
struct RequestedError {
  std::optional<double> error_m;   // finite, > 0
  std::optional<double> fraction;  // of the level's error; finite, > 0
  bool at_least = false;           // the larger of error_m and the level's default error is used
};

// The step on the level's ladder for a requested error. `is_deepest`: the level is the deepest of the
// sources, or one that edits added below it. Finer levels add no detail of the sources, so `atleast` does not limit its
// tiles to their default error. `default_steps`: by level, the steps
// if no error is requested; 0 beyond (BakedExtent::error_steps).
int ErrorStep(const RequestedError& requested, int level, bool is_deepest, double error_fraction,
              std::span<const int> default_steps = {});

}  // namespace terrace::tiler
