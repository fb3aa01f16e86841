#include "proto/mesh/tile_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/core/check.h"

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

// Caches sines and cosines: thousands of vertices share a few hundred coordinates.
template <typename Degrees>
class Angles {
 public:
  explicit Angles(Degrees degrees) : degrees_(std::move(degrees)), index_(kQuantizedMax + 1) {}

  geo::SinCos At(std::uint16_t coordinate) {
    std::uint16_t& index = index_[coordinate];
    if (index == 0) {
      known_.push_back(geo::RoundedSinCos(degrees_(coordinate)));
      index = static_cast<std::uint16_t>(known_.size());
    }
    return known_[index - std::size_t{1}];
  }

 private:
  const Degrees degrees_;
  std::vector<std::uint16_t> index_;  // index of the known value, from 1 on; 0: not known yet
  std::vector<geo::SinCos> known_;
};

geo::Vec3 Scaled(geo::Vec3 p, double shrink) {
  return {p.x / (geo::kSemiMajorAxis - shrink), p.y / (geo::kSemiMajorAxis - shrink),
          p.z / (geo::kSemiMinorAxis - shrink)};
}

// How far along `direction` (unit, scaled space) the tangent from `p` to the unit sphere meets it; not positive where
// it does not. With a the angle between p and the direction, and b the angle from p to where the tangent touches:
//
//            H        |H| = 1 / cos(a + b)
//           /|\       cos b = 1 / |p|, at least one: positions inside the sphere count as on it
//         p/ | \      .
//         /a |  \     .
//     b_/.---+---.\_
double TangentReach(geo::Vec3 p, geo::Vec3 direction) {
  const double length = geo::Length(p);
  const double cos_a = geo::Dot(p, direction) / length;
  const double sin_a = geo::Length(geo::Cross(p, direction)) / length;
  const double squared = std::max(1.0, length * length);
  const double cos_b = 1 / std::sqrt(squared);
  const double sin_b = std::sqrt(squared - 1) * cos_b;
  return 1 / (cos_a * cos_b - sin_a * sin_b);
}

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
  positions.reserve(tile.u.size());
  Angles longitudes([&](std::uint16_t u) { return LongitudeAt(tile.key, u); });
  Angles latitudes([&](std::uint16_t v) { return LatitudeAt(tile.key, v); });
  for (std::size_t i = positions.size(); i < tile.u.size(); ++i) {
    positions.push_back(geo::ToEcef(longitudes.At(tile.u[i]), latitudes.At(tile.v[i]), HeightAt(tile, tile.h[i])));
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
  const geo::Vec3 ray = geo::Normalized(Scaled(direction, 0));
  double reach = 1;
  for (const geo::Vec3& p : positions) {
    const double plain = TangentReach(Scaled(p, 0), ray);
    const double shrunk = shrink > 0 ? TangentReach(Scaled(p, shrink), ray) : plain;
    // Also false for NaN, which a direction or position at the Earth's centre gives.
    const bool exists = plain > 0 && plain <= kMaxHorizonMagnitude && shrunk > 0 && shrunk <= kMaxHorizonMagnitude;
    if (!exists) return kNeverCulled;
    reach = std::max({reach, plain, shrunk});
  }
  return ray * (reach * (1 + kHorizonPad));
}

}  // namespace terrace::proto
