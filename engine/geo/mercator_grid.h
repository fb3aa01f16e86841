// The pixels of Web Mercator (EPSG:3857) raster tiles in the XYZ scheme of web maps.
//
// The world is one square of (256 << depth) x (256 << depth) pixels: columns count eastwards from -180 degrees, rows
// count from the NORTH, from 85.0511 degrees. A tile of 256 pixels at level z lies on the grid of depth z, a tile of
// 512 pixels on the grid of depth z + 1. A pixel does not depend on the tile that contains it.
#pragma once

#include <cstdint>

namespace terrace::geo {

// atan(sinh(pi)): the latitude at which the square ends.
inline constexpr double kMercatorLatitude = 85.051128779806604;

struct MercatorGrid {
  int depth = 0;

  std::int64_t columns() const { return std::int64_t{256} << depth; }
  std::int64_t rows() const { return columns(); }

  double StepDegrees() const { return 360.0 / static_cast<double>(columns()); }  // of longitude

  // Degrees of a pixel's centre. Columns beyond the last continue east of 180 degrees. Latitudes are computed from
  // additions, multiplications, divisions and square roots only, which round equally on every processor; libm's
  // functions do not.
  double Longitude(std::int64_t column) const;
  double Latitude(std::int64_t row) const;
};

// Returns degrees. `y`: from 0 at the northern end of the square to 1 at its southern end.
double MercatorLatitude(double y);

}  // namespace terrace::geo
