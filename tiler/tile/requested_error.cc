#include "tiler/tile/requested_error.h"

#include <algorithm>
#include <limits>

namespace terrace::tiler {

int ErrorStep(const RequestedError& requested, int level, const ErrorScale& scale) {
  if (requested.fraction) {
    // The product may overflow or underflow; the ladder's ends lie far inside the range of doubles.
    const double error_m = std::clamp(*requested.fraction * geo::LevelError(level), std::numeric_limits<double>::min(),
                                      std::numeric_limits<double>::max());
    return geo::SnapToLadder(level, error_m, scale.fraction);
  }
  if (!requested.error_m) {
    const auto at = static_cast<std::size_t>(level);
    return at < scale.default_steps.size() ? scale.default_steps[at] : 0;
  }
  const int step = geo::SnapToLadder(level, *requested.error_m, scale.fraction);
  // max(error, default): steps above 0 are finer than the default.
  return requested.at_least && level < scale.max_source_level ? std::min(step, 0) : step;
}

}  // namespace terrace::tiler
