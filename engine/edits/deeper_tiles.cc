#include "engine/edits/deeper_tiles.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/edits/edit_shape.h"
#include "engine/geo/error_ladder.h"

namespace terrace::dem {

int LevelFor(const Edit& edit, double error_fraction, int deepest) {
  if (edit.op != EditOp::kPrecision || !std::isfinite(edit.error_m)) return -1;
  int level = 0;
  while (level < deepest && geo::DefaultError(level, error_fraction) > edit.error_m) ++level;
  // Without effect there: its tiles would be those of the sources.
  return level < edit.min_level ? -1 : level;
}

std::vector<geo::TileRange> TilesTouching(const Edit& edit, int level) {
  constexpr std::int64_t kMaxBoxes = 64;  // along an axis
  const double east_m = edit.blend_m / edit.plane.east_m, north_m = edit.blend_m / edit.plane.north_m;
  const Box box{edit.reach.min_x + east_m, edit.reach.min_y + north_m, edit.reach.max_x - east_m,
                edit.reach.max_y - north_m};
  const auto at = [](double degrees, double side) { return static_cast<std::int64_t>(std::floor(degrees / side)); };
  int coarser = 0;
  double side = 0;
  std::int64_t west = 0, east = 0, south = 0, north = 0;
  for (;; ++coarser) {
    side = std::ldexp(180, coarser - level);
    west = at(box.min_x + 180, side), east = at(box.max_x + 180, side);
    south = std::max<std::int64_t>(at(box.min_y + 90, side), 0), north = at(box.max_y + 90, side);
    north = std::min(north, geo::TileRows(level - coarser) - 1);
    if (coarser == level || std::max(east - west, north - south) < kMaxBoxes) break;
  }
  // A box is touched if its centre is no further away than half its diagonal.
  Edit grown = edit;
  grown.blend_m = std::hypot(side * edit.plane.east_m, side * edit.plane.north_m) / 2;
  Complete(grown);
  std::vector<geo::TileRange> tiles;
  const std::int64_t around = geo::TileColumns(level - coarser);
  for (std::int64_t y = south; y <= north; ++y) {
    const EditRow row(grown, edit.plane.Y((static_cast<double>(y) + 0.5) * side - 90));
    for (std::int64_t x = west; x <= east; ++x) {
      const EditPlace place = row.At(edit.plane.X((static_cast<double>(x) + 0.5) * side - 180));
      if (place.distance_m > grown.reach_m()) continue;
      const std::int64_t column = ((x % around) + around) % around;
      const geo::TileRange range{column << coarser, y << coarser, ((column + 1) << coarser) - 1,
                                 ((y + 1) << coarser) - 1};
      if (!tiles.empty() && tiles.back().start_y == range.start_y && tiles.back().end_x + 1 == range.start_x) {
        tiles.back().end_x = range.end_x;
      } else {
        tiles.push_back(range);
      }
    }
  }
  return tiles;
}

}  // namespace terrace::dem
