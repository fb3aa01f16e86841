// Groups rasters that lie on one pixel grid and touch each other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/crs/georeference.h"
#include "engine/crs/vertical_datum.h"

namespace terrace::dem {

// The georeference and vertical datum of a raster. Both must outlive the users of this struct.
struct PlacedRaster {
  const Georeference* where = nullptr;
  const VerticalDatum* vertical = nullptr;
};

struct LaidRaster {
  std::size_t raster = 0;            // index into the input
  std::int64_t column = 0, row = 0;  // of its first pixel in the group
};

// Members in ascending order. The origin of pixels is the north-western corner of the group; for a group around the
// whole Earth, the westernmost raster.
struct GridLayout {
  std::vector<LaidRaster> members;
  int width = 0, height = 0;
};

// Puts each raster into exactly one layout. Layouts are ordered by their first members. Takes O(n log n) time, unless
// many rasters overlap or pixel sizes nearly agree (GridFinder). Sets `pairs`, where given, to the number of pairs of
// rasters that were compared; tests count them.
std::vector<GridLayout> LayOutGrids(std::span<const PlacedRaster> rasters, std::size_t* pairs = nullptr);

}  // namespace terrace::dem
