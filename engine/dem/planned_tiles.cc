#include "engine/dem/planned_tiles.h"

#include <algorithm>

#include "engine/crs/footprint.h"
#include "engine/crs/level_plan.h"
#include "engine/mosaic/availability.h"

namespace terrace::dem {

std::vector<geo::TileRange> TilesOverlapping(const GeoBounds& box, int level) {
  return TilesOverlapping(Footprint::Of(box), level);
}

std::vector<GeoBounds> CommonBounds(const GeoBounds& a, const GeoBounds& b) {
  const Footprint first = Footprint::Of(a), second = Footprint::Of(b);
  const double south = std::max(first.south, second.south), north = std::min(first.north, second.north);
  std::vector<GeoBounds> common;
  if (south >= north) return common;
  for (const double turn : {0.0, -360.0, 360.0}) {
    const double west = std::max(first.west, second.west + turn), east = std::min(first.east, second.east + turn);
    if (west >= east) continue;
    common.push_back({west >= 180 ? west - 360 : west, south, east > 180 ? east - 360 : east, north});
  }
  return common;
}

std::vector<std::vector<geo::TileRange>> PlannedTiles(std::span<const PlannedRaster> rasters, double error_fraction) {
  std::vector<SourceExtent> extents;
  for (const PlannedRaster& raster : rasters) {
    SourceSpacing spacing;
    spacing.finer = std::min(raster.east_step_m, raster.north_step_m);
    extents.push_back({Footprint::Of(raster.bounds), DeepestLevel(spacing, error_fraction, std::nullopt)});
  }
  return AvailableTiles(extents);
}

}  // namespace terrace::dem
