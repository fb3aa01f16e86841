// Reads all samples of a raster, for `terrace mesh`.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

struct ReadOptions {
  bool find_voids = true;           // detects undeclared nodata values (undeclared_nodata.h)
  std::vector<double> nodata = {};  // further raw values that mean void
  std::function<void(double)> progress = {};
};

// The samples of a raster in the order of the file: row 0 is the first row, voids are NaN. Needs no georeference.
struct RasterHeights {
  int width = 0, height = 0;
  std::vector<float> heights;
  bool georeferenced = false;
  std::array<double, 6> geo_transform{};  // GDAL's order: x0, dx/dcol, dx/drow, y0, dy/dcol, dy/drow (pixel corners)
  std::string coordinate_unit;            // "US survey foot"; empty: metres, degrees or unknown
  bool in_angles = false;                 // x and y are longitudes and latitudes
  std::string found_voids;                // detected nodata values, for people; empty: none
  std::string picture_color;              // as RasterInfo::picture_color
  std::string heights_doubted;            // why heights may not be metres, with the remedy; empty: plausible
};
Result<RasterHeights> ReadRaster(const std::string& path, const ReadOptions& options = {});

}  // namespace terrace::dem
