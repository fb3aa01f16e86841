// Which rasters lie on one pixel grid and touch each other, and where in the whole that they make.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/dem/mosaic/grid_finder.h"

namespace terrace::dem {

struct LaidRaster {
  std::size_t raster = 0;            // its number among those given
  std::int64_t column = 0, row = 0;  // of its first pixel
};

// Members ascend by their numbers. Pixels are counted from the north-western corner of all; from the westernmost raster
// where they go all around the Earth.
struct GridLayout {
  std::vector<LaidRaster> members;
  int width = 0, height = 0;
};

// Every raster is in one of the layouts; layouts come in the order of their first members. Takes n log n time, unless
// rasters pile up or pixel sizes nearly agree (GridFinder).
std::vector<GridLayout> LayOutGrids(std::span<const PlacedRaster> rasters);

}  // namespace terrace::dem
