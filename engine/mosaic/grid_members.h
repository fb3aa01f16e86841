// The rasters of a raster grid: their pixels lie on one grid, they touch each other, and they share a vertical datum,
// as the tiles of one product do.
//
// Reading them as one raster leaves no seams: averages, void filling and interpolation cross the joints, and a row or
// column that neighbours share counts once.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/geo/tile_key.h"
#include "engine/sources/raster_source.h"

namespace terrace::dem {

// An inclusive block of pixels, or of averages, of a raster grid: x is the column, y the row from the north.
using PixelRange = geo::TileRange;

struct GridMember {
  std::shared_ptr<const RasterSource> raster;
  std::int64_t column = 0, row = 0;  // of its first pixel in the raster grid
  // The largest offset of its samples from the raster grid on each axis, in pixels. Set by the raster grid.
  Position misplacement = {0, 0};

  PixelRange pixels() const {
    return {column, row, column + raster->layout().width - 1, row + raster->layout().height - 1};
  }
};

// Members in input order. The origin of pixels is the north-western corner of all.
struct GridPlan {
  std::vector<GridMember> members;
  int width = 0, height = 0;
};

// Puts each raster into exactly one plan: LayOutGrids (grid_layout.h) with the rasters themselves. Plans are ordered by
// their first members.
std::vector<GridPlan> PlanGrids(const std::vector<std::shared_ptr<const RasterSource>>& rasters);

}  // namespace terrace::dem
