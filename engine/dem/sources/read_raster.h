// A raster's samples as they lie in the file.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

struct ReadOptions {
  bool find_voids = true;           // detects undeclared nodata values (undeclared_nodata.h)
  std::vector<double> nodata = {};  // further raw values that are voids
  std::function<void(double)> progress = {};
};

// A raster's samples as they lie in the file, for `terrace mesh`: row 0 in the north, voids NaN, no georeference
// needed.
struct RasterHeights {
  int width = 0, height = 0;
  std::vector<float> heights;
  bool georeferenced = false;
  std::array<double, 6> geo_transform{};  // GDAL's order: x0, dx/dcol, dx/drow, y0, dy/dcol, dy/drow (pixel corners)
  std::string coordinate_unit;            // in feet, kilometres ..: their name; empty: metres, degrees, or not known
  bool in_angles = false;                 // x and y are longitudes and latitudes
  std::string found_voids;                // what find_voids found, for people; empty: nothing
  std::string picture_part;               // as RasterInfo has it
};
Result<RasterHeights> ReadRaster(const std::string& path, const ReadOptions& options = {});

}  // namespace terrace::dem
