// Which rasters make one raster grid: those whose pixels lie on one grid and touch each other.
//
// Tiles of one product are cut from one grid, and count from one datum. Read as one raster they have no joints:
// averages, bridges over voids and interpolation go across, and a row or column that neighbours share counts once.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/dem/sources/raster_source.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

struct GridMember {
  std::shared_ptr<const RasterSource> raster;
  std::int64_t column = 0, row = 0;  // of its first pixel in the raster grid
  // Pixels by which its samples lie off those of the raster grid, the most on each axis. Set by the raster grid.
  Position misplacement = {0, 0};

  geo::TileRange pixels() const {  // y is the row, downwards
    return {column, row, column + raster->layout().width - 1, row + raster->layout().height - 1};
  }
};

// Members in the order given, their pixels counted from the north-western corner of all.
struct GridPlan {
  std::vector<GridMember> members;
  int width = 0, height = 0;
};

// Every raster is in one of the plans; plans come in the order of their first members.
std::vector<GridPlan> PlanGrids(const std::vector<std::shared_ptr<const RasterSource>>& rasters);

}  // namespace terrace::dem
