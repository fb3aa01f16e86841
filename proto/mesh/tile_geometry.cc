#include "proto/mesh/tile_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "engine/core/check.h"
#include "engine/geo/sines.h"
#include "proto/mesh/horizon_reach.h"

namespace terrace::proto {
namespace {

// geo::ToEcef rounds sines to 2^-44, which moves a position by up to 0.4 micrometres.
constexpr double kDecodingPad_m = 1e-6;
constexpr double kRoundingPad = 1e-12;

// The horizon point is moved out by 6 cm: CesiumJS evaluates sqrt(|p|^2 - 1) near zero, where one unit in the last
// place of |p|^2 is 1.5e-8.
constexpr double kHorizonPad = 1e-8;
// A tile whose point would be farther away (a direction almost 90 degrees off) is not worth culling.
constexpr double kMaxHorizonMagnitude = 100;

double AlongAxis(std::int64_t tile, std::uint16_t quantized, int level) {
  // The product is below 2^49 and therefore exact; only the division rounds.
  const double steps = static_cast<double>((tile * kQuantizedMax + quantized) * 180);
  return steps / static_cast<double>(geo::TileRows(level) * kQuantizedMax);
}

struct Extent {
  geo::Vec3 min, max;  // positions, the smallest and the largest along one axis
};

std::array<Extent, 3> ExtentsByAxis(const std::vector<geo::Vec3>& positions) {
  std::array<Extent, 3> axes;
  axes.fill({positions.front(), positions.front()});
  constexpr std::array<double geo::Vec3::*, 3> kAxes = {&geo::Vec3::x, &geo::Vec3::y, &geo::Vec3::z};
  for (const geo::Vec3& p : positions) {
    for (std::size_t i = 0; i < axes.size(); ++i) {
      if (p.*kAxes[i] < axes[i].min.*kAxes[i]) axes[i].min = p;
      if (p.*kAxes[i] > axes[i].max.*kAxes[i]) axes[i].max = p;
    }
  }
  return axes;
}

BoundingSphere RitterSphere(const std::vector<geo::Vec3>& positions, const std::array<Extent, 3>& axes) {
  const Extent& widest = *std::max_element(axes.begin(), axes.end(), [](const Extent& a, const Extent& b) {
    return geo::Length(a.max - a.min) < geo::Length(b.max - b.min);
  });
  BoundingSphere sphere{(widest.min + widest.max) * 0.5, geo::Length(widest.max - widest.min) / 2};
  for (const geo::Vec3& p : positions) {
    const double distance = geo::Length(p - sphere.center);
    if (distance <= sphere.radius) continue;
    sphere.radius = (sphere.radius + distance) / 2;
    sphere.center = sphere.center + (p - sphere.center) * ((distance - sphere.radius) / distance);
  }
  return sphere;
}

double FarthestFrom(geo::Vec3 center, const std::vector<geo::Vec3>& positions) {
  double squared = 0;
  for (const geo::Vec3& p : positions) squared = std::max(squared, geo::Dot(p - center, p - center));
  return std::sqrt(squared);
}

// The different ones among coordinates: thousands of vertices share a few hundred. Those of different nodes of a
// lattice have different slots, so each is found; others may occur twice.
class DistinctCoordinates {
 public:
  explicit DistinctCoordinates(std::span<const std::uint16_t> coordinates) {
    constexpr unsigned kMaxCells = 256, kRange = kQuantizedMax + 1;
    constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
    std::array<std::size_t, kMaxCells + 1> last;  // by slot
    last.fill(kNone);
    places_.reserve(coordinates.size());
    for (const std::uint16_t coordinate : coordinates) {
      std::size_t& place = last[(coordinate * kMaxCells + kRange / 2) / kRange];
      if (place == kNone || values_[place] != coordinate) {
        place = values_.size();
        values_.push_back(coordinate);
      }
      places_.push_back(static_cast<std::uint32_t>(place));
    }
  }

  // Of each coordinate that occurs.
  template <typename Degrees>
  std::vector<geo::SinCos> Angles(const Degrees& degrees) const {
    std::vector<double> all;
    all.reserve(values_.size());
    for (const std::uint16_t value : values_) all.push_back(degrees(value));
    return geo::RoundedSinCosOf(all);
  }
  // Where the angle of the coordinate k is.
  std::size_t PlaceOf(std::size_t k) const { return places_[k]; }

 private:
  std::vector<std::uint16_t> values_;
  std::vector<std::uint32_t> places_;
};

}  // namespace

double LongitudeAt(const geo::TileKey& key, std::uint16_t u) { return AlongAxis(key.x, u, key.level) - 180; }

double LatitudeAt(const geo::TileKey& key, std::uint16_t v) { return AlongAxis(key.y, v, key.level) - 90; }

double HeightAt(const QuantizedTile& tile, std::uint16_t h) {
  const double min = tile.min_height, max = tile.max_height;
  return min + (max - min) * h / kQuantizedMax;
}

std::vector<geo::Vec3> DecodePositions(const QuantizedTile& tile) {
  std::vector<geo::Vec3> positions;
  DecodeFurtherPositions(tile, positions);
  return positions;
}

void DecodeFurtherPositions(const QuantizedTile& tile, std::vector<geo::Vec3>& positions) {
  const std::size_t first = positions.size();
  const DistinctCoordinates u(std::span(tile.u).subspan(first)), v(std::span(tile.v).subspan(first));
  const std::vector<geo::SinCos> longitudes = u.Angles([&](std::uint16_t at) { return LongitudeAt(tile.key, at); }),
                                 latitudes = v.Angles([&](std::uint16_t at) { return LatitudeAt(tile.key, at); });
  std::vector<double> radii_m;
  radii_m.reserve(latitudes.size());
  for (const geo::SinCos& latitude : latitudes) radii_m.push_back(geo::PrimeVerticalRadius(latitude));
  positions.reserve(tile.u.size());
  for (std::size_t i = first; i < tile.u.size(); ++i) {
    const std::size_t parallel = v.PlaceOf(i - first);
    positions.push_back(geo::ToEcef(longitudes[u.PlaceOf(i - first)], latitudes[parallel], radii_m[parallel],
                                    HeightAt(tile, tile.h[i])));
  }
}

BoundingSphere EnclosingSphere(const std::vector<geo::Vec3>& positions) {
  TERRACE_CHECK(!positions.empty());
  const std::array<Extent, 3> axes = ExtentsByAxis(positions);
  const geo::Vec3 low{axes[0].min.x, axes[1].min.y, axes[2].min.z}, high{axes[0].max.x, axes[1].max.y, axes[2].max.z};
  BoundingSphere box{(low + high) * 0.5, 0};
  BoundingSphere ritter = RitterSphere(positions, axes);
  // Ritter's radius grows while its centre moves. The radius is measured afterwards, which is smaller and exact.
  box.radius = FarthestFrom(box.center, positions);
  ritter.radius = FarthestFrom(ritter.center, positions);
  BoundingSphere sphere = ritter.radius < box.radius ? ritter : box;
  sphere.radius = sphere.radius * (1 + kRoundingPad) + kDecodingPad_m;
  return sphere;
}

geo::Vec3 HorizonOcclusionPoint(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double min_height) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  constexpr geo::Vec3 kNeverCulled{kNaN, kNaN, kNaN};
  const double shrink = std::max(0.0, -min_height);
  TERRACE_CHECK(shrink < geo::kSemiMinorAxis);
  const geo::Vec3 ray = geo::Normalized(
      {direction.x / geo::kSemiMajorAxis, direction.y / geo::kSemiMajorAxis, direction.z / geo::kSemiMinorAxis});
  double reach = 1;
  // Also false for NaN, which a direction or position at the Earth's centre gives.
  if (!RaiseReach(positions, ray, 0, kMaxHorizonMagnitude, reach)) return kNeverCulled;
  if (shrink > 0 && !RaiseReach(positions, ray, shrink, kMaxHorizonMagnitude, reach)) return kNeverCulled;
  return ray * (reach * (1 + kHorizonPad));
}

}  // namespace terrace::proto
