#include "tiler/map/relief.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/sine.h"

namespace terrace::tiler {
namespace {

// Metres between pixels at a row.
struct PixelStep {
  double east, north;
};

PixelStep StepAt(const geo::MercatorGrid& grid, std::int64_t row) {
  const double latitude = grid.Latitude(row);
  const geo::SinCos at = geo::RoundedSinCos(latitude);
  // From the middle of the row above to that of the row below; Web Mercator has rows beyond its square, too.
  const double degrees = grid.Latitude(row - 1) - grid.Latitude(row + 1);
  return {grid.StepDegrees() * geo::MetresPerDegreeEast(at), degrees / 2 * geo::MetresPerDegreeNorth(at)};
}

// tan(a) of the angles between two steps, squared: the first step whose upper end is steeper is the nearest one.
const std::array<double, kSlopeSteps - 1>& SquaredTangents() {
  static const auto tangents = [] {
    std::array<double, kSlopeSteps - 1> made;
    for (std::size_t i = 0; i < made.size(); ++i) {
      const geo::SinCos angle = geo::RoundedSinCos((static_cast<double>(i) + 0.5) / 2);
      made[i] = angle.sin / angle.cos * (angle.sin / angle.cos);
    }
    return made;
  }();
  return tangents;
}

struct ColorStop {
  int degrees;
  std::array<int, 3> color;
};
constexpr ColorStop kColorStops[] = {{0, {255, 255, 255}}, {10, {186, 228, 179}}, {20, {255, 237, 160}},
                                     {30, {254, 178, 76}}, {40, {240, 59, 32}},   {50, {128, 0, 128}},
                                     {60, {40, 0, 60}},    {90, {0, 0, 0}}};

}  // namespace

std::vector<Gradient> GradientsOf(const MapHeights& heights, const MapWindow& window) {
  TERRACE_CHECK(window.margin == kReliefMargin);
  const geo::MercatorGrid grid{window.depth};
  std::vector<Gradient> gradients(dem::Area(window.size, window.size));
  Gradient* out = gradients.data();
  for (int row = 1; row <= window.size; ++row) {
    const PixelStep step = StepAt(grid, window.first_row + row);
    for (int column = 1; column <= window.size; ++column, ++out) {
      const float own = heights.At(column, row);
      if (std::isnan(own)) {  // Horn's formula does not use it
        *out = {own, own};
        continue;
      }
      // At the rim of the data, the ground goes on as on the other side.
      const auto beside = [&](int east, int south) -> double {
        const float height = heights.At(column + east, row + south);
        if (!std::isnan(height)) return height;
        const float opposite = heights.At(column - east, row - south);
        return std::isnan(opposite) ? own : 2.0 * own - opposite;
      };
      const auto at = [&](int east, int south) -> double {
        const float height = heights.At(column + east, row + south);
        if (!std::isnan(height)) return height;
        return east == 0 || south == 0 ? beside(east, south) : beside(east, 0) + beside(0, south) - own;
      };
      const double rise_east = at(1, -1) + 2 * at(1, 0) + at(1, 1) - (at(-1, -1) + 2 * at(-1, 0) + at(-1, 1));
      const double rise_north = at(-1, -1) + 2 * at(0, -1) + at(1, -1) - (at(-1, 1) + 2 * at(0, 1) + at(1, 1));
      *out = {rise_east / (8 * step.east), rise_north / (8 * step.north)};
    }
  }
  return gradients;
}

Hillshade::Hillshade(const MapParameters& parameters) : z_factor_(parameters.z_factor_hundredths / 100.0) {
  const geo::SinCos azimuth = geo::RoundedSinCos(parameters.azimuth_deg);
  const geo::SinCos altitude = geo::RoundedSinCos(parameters.altitude_deg);
  up_ = altitude.sin;
  east_ = altitude.cos * azimuth.sin;
  north_ = altitude.cos * azimuth.cos;
}

std::uint8_t Hillshade::Of(const Gradient& gradient) const {
  const double east = z_factor_ * gradient.east, north = z_factor_ * gradient.north;
  if (std::isnan(east) || std::isnan(north)) return 0;
  // The upward normal is (-east, -north, 1).
  const double light = (up_ - east_ * east - north_ * north) / std::sqrt(1 + east * east + north * north);
  return static_cast<std::uint8_t>(std::floor(1 + 254 * std::clamp(light, 0.0, 1.0) + 0.5));
}

int SlopeStep(const Gradient& gradient) {
  const double squared = gradient.east * gradient.east + gradient.north * gradient.north;
  if (std::isnan(squared)) return kNoSlope;
  const auto& tangents = SquaredTangents();
  return static_cast<int>(std::ranges::upper_bound(tangents, squared) - tangents.begin());
}

const std::array<std::array<std::uint8_t, 3>, kSlopeSteps>& SlopeColors() {
  static const auto colors = [] {
    std::array<std::array<std::uint8_t, 3>, kSlopeSteps> made;
    const ColorStop* stop = kColorStops;
    for (int step = 0; step < kSlopeSteps; ++step) {
      if (step > 2 * stop[1].degrees) ++stop;
      const int width = 2 * (stop[1].degrees - stop[0].degrees), part = step - 2 * stop[0].degrees;
      for (std::size_t c = 0; c < 3; ++c) {
        const int mixed = stop[0].color[c] * (width - part) + stop[1].color[c] * part;
        made[static_cast<std::size_t>(step)][c] = static_cast<std::uint8_t>((2 * mixed + width) / (2 * width));
      }
    }
    return made;
  }();
  return colors;
}

}  // namespace terrace::tiler
