// Slopes and shades of a map tile, from gradients by Horn's formula (Horn, Hill Shading and the Reflectance Map, 1981)
// over 3 x 3 pixels, as `gdaldem` computes them. Distances are those on the ellipsoid at each row, not those of the
// map. Uses no function of the C library whose rounding differs between processors.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tiler/map/map_heights.h"
#include "tiler/map/map_parameters.h"

namespace terrace::tiler {

// Pixels around a tile that its gradients depend on.
inline constexpr int kReliefMargin = 1;

// Metres of height per metre to the east and to the north; NaN where there is no height. A neighbour without a height
// counts as if the ground went on as on the pixel's other side; without a height there, with the pixel's own height.
struct Gradient {
  double east = 0, north = 0;
};

// One gradient for each pixel of the tile. Precondition: a margin of kReliefMargin.
std::vector<Gradient> GradientsOf(const MapHeights& heights, const MapWindow& window);

// Light that falls on a surface, as `gdaldem hillshade` codes it: 1 in the shade, 255 where the light is perpendicular.
// 0: NaN.
class Hillshade {
 public:
  explicit Hillshade(const MapParameters& parameters);
  std::uint8_t Of(const Gradient& gradient) const;

 private:
  double z_factor_, up_, east_, north_;  // the unit vector to the light
};

// Slopes in whole half degrees: 0 .. 180.
inline constexpr int kSlopeSteps = 181;
inline constexpr int kNoSlope = -1;

// The nearest half degree of a slope; kNoSlope: NaN.
int SlopeStep(const Gradient& gradient);

// Colours of the steps: interpolated between those of docs/http-api.md.
const std::array<std::array<std::uint8_t, 3>, kSlopeSteps>& SlopeColors();

}  // namespace terrace::tiler
