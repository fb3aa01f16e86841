#include "tiler/tile/requested_error.h"

#include <algorithm>
#include <limits>

#include "engine/geo/error_ladder.h"

namespace terrace::tiler {

int ErrorStep(const RequestedError& requested, int level, bool is_deepest, double error_fraction,
              std::span<const int> default_steps) {
  if (requested.fraction) {
    // The product may overflow or underflow; the ladder's ends lie far inside the range of doubles.
    const double error_m = std::clamp(*requested.fraction * geo::LevelError(level), std::numeric_limits<double>::min(),
                                      std::numeric_limits<double>::max());
    return geo::SnapToLadder(level, error_m, error_fraction);
  }
  if (!requested.error_m) {
    const auto at = static_cast<std::size_t>(level);
    return at < default_steps.size() ? default_steps[at] : 0;
  }
  const int step = geo::SnapToLadder(level, *requested.error_m, error_fraction);
  // max(error, default): steps above 0 are finer than the default.
  return requested.at_least && !is_deepest ? std::min(step, 0) : step;
}

}  // namespace terrace::tiler
