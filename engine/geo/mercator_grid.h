// The pixels of Web Mercator (EPSG:3857) raster tiles in the XYZ scheme of web maps.
//
// The world is one square of (256 << depth) x (256 << depth) pixels: columns count eastwards from -180 degrees, rows
// count from the NORTH, from 85.0511 degrees. A tile of 256 pixels at level z lies on the grid of depth z, one of 512
// pixels on that of depth z + 1: a pixel is the same whatever tile holds it.
#pragma once

#include <cstdint>

namespace terrace::geo {

// atan(sinh(pi)): where the square ends.
inline constexpr double kMercatorLatitude = 85.051128779806604;

struct MercatorGrid {
  int depth = 0;

  std::int64_t columns() const { return std::int64_t{256} << depth; }
  std::int64_t rows() const { return columns(); }

  double StepDegrees() const { return 360.0 / static_cast<double>(columns()); }  // of longitude

  // Degrees of a pixel's centre. Columns beyond the last go on eastwards of 180 degrees. Latitudes come from additions,
  // multiplications, divisions and square roots alone, which round equally everywhere; libm's functions do not.
  double Longitude(std::int64_t column) const;
  double Latitude(std::int64_t row) const;
};

// Degrees; `y` counts from the northern end of the square, 0, to its southern end, 1.
double MercatorLatitude(double y);

}  // namespace terrace::geo
