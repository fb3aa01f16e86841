// The parameters of tiles for maps. They are whole numbers, so that equal requests have one form.
#pragma once

#include <cstdint>

#include "proto/documents/picture_types.h"

namespace terrace::tiler {

enum class SlopeStyle : std::uint8_t {
  kColors,   // a colour for each slope
  kDegrees,  // grey: twice the slope in degrees
};

// Members that the TileFormat of the request does not use must have their defaults.
struct MapParameters {
  // Unused by kContours. kJpeg is not permitted for kHillshade and kSlope.
  proto::PictureFormat picture = proto::PictureFormat::kPng;
  // kHillshade only.
  std::uint16_t azimuth_deg = 315;               // where the light comes from, clockwise from north, 0 .. 359
  std::uint8_t altitude_deg = 45;                // of the light above the horizon, 0 .. 90
  std::uint16_t z_factor_hundredths = 100;       // heights are multiplied by a hundredth of it, 1 .. 10000
  SlopeStyle slope_style = SlopeStyle::kColors;  // kSlope only
  // kContours only: between contours, > 0. The encoder multiplies it by 5 until the tile has few enough points.
  std::uint32_t interval_cm = 0;

  friend bool operator==(const MapParameters&, const MapParameters&) = default;
};

}  // namespace terrace::tiler
