#include "tiler/surface/drawn_surface.h"

#include "engine/geo/error_ladder.h"

namespace terrace::tiler {

Result<int> LevelOf(const DrawnSurface& surface, int max_level, double error_fraction) {
  if (surface.level && (*surface.level < 0 || *surface.level > max_level)) {
    return MakeError(ErrorCode::kInvalidArgument, "level: the dataset has levels from 0 to {}", max_level);
  }
  if (surface.level) return *surface.level;
  if (!surface.requested.error_m) return max_level;
  int level = 0;
  while (level < max_level && geo::DefaultError(level, error_fraction) > *surface.requested.error_m) ++level;
  return level;
}

}  // namespace terrace::tiler
