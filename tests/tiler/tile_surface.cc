#include "tests/tiler/tile_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace terrace::tiler {
namespace {

constexpr double kMaxUv = 32767;  // u and v at the eastern and the northern edge

// The direction of the plumb line at a position, and its foot on the ellipsoid.
geo::Vec3 UpAt(double longitude, double latitude) {
  const double x = longitude * std::numbers::pi / 180, y = latitude * std::numbers::pi / 180;
  return {std::cos(y) * std::cos(x), std::cos(y) * std::sin(x), std::sin(y)};
}
geo::Vec3 FootAt(const geo::Vec3& up) {
  const double across = geo::kSemiMajorAxis / std::sqrt(1 - geo::kEccentricitySquared * up.z * up.z);
  return {across * up.x, across * up.y, across * (1 - geo::kEccentricitySquared) * up.z};
}

// Geodetic latitude of a point in degrees.
double LatitudeOf(const geo::Vec3& point) {
  const double radius = std::hypot(point.x, point.y);
  double latitude = std::atan2(point.z, radius * (1 - geo::kEccentricitySquared));
  for (int step = 0; step < 4; ++step) {
    const double sine = std::sin(latitude);
    const double across = geo::kSemiMajorAxis / std::sqrt(1 - geo::kEccentricitySquared * sine * sine);
    latitude = std::atan2(point.z + geo::kEccentricitySquared * across * sine, radius);
  }
  return latitude * 180 / std::numbers::pi;
}

}  // namespace

TileSurface::TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key)
    : mesh_(mesh),
      bins_per_side_(std::clamp(static_cast<int>(std::sqrt(static_cast<double>(mesh.triangles.size()))), 1, 512)),
      bins_(static_cast<std::size_t>(bins_per_side_ * bins_per_side_)) {
  side_ = 180.0 / static_cast<double>(geo::TileRows(key.level));
  west_ = side_ * static_cast<double>(key.x) - 180;
  south_ = side_ * static_cast<double>(key.y) - 90;
  for (std::size_t k = 0; k < mesh.u.size(); ++k) {
    const geo::Vec3 up = UpAt(west_ + side_ * mesh.u[k] / kMaxUv, south_ + side_ * mesh.v[k] / kMaxUv);
    ecef_.push_back(FootAt(up) + up * HeightOf(k));
  }
  for (const auto& corners : mesh.triangles) AddTriangle(corners);
}

void TileSurface::AddTriangle(const std::array<std::uint32_t, 3>& corners) {
  Triangle triangle;
  std::ranges::copy(corners, triangle.k.begin());
  const geo::Vec3 &a = ecef_[corners[0]], &b = ecef_[corners[1]], &c = ecef_[corners[2]];
  triangle.normal = geo::Cross(b - a, c - a);
  triangle.longest = std::max({geo::Length(b - a), geo::Length(c - a), geo::Length(c - b)});
  FindExtent(triangle);
  for (int v = BinOf(triangle.south); v <= BinOf(triangle.north); ++v) {
    for (int u = BinOf(triangle.west); u <= BinOf(triangle.east); ++u) {
      bins_[static_cast<std::size_t>(v * bins_per_side_ + u)].push_back(triangles_.size());
    }
  }
  triangles_.push_back(triangle);
}

// A triangle is between the meridians of its corners, because a wedge is convex. Chords bulge towards the pole.
void TileSurface::FindExtent(Triangle& triangle) const {
  // Small triangles far from the poles bulge by less than this and need no exact test.
  constexpr double kSmall = 20'000, kRadius = 6'356'000, kFromPole = 10;  // metres, degrees
  const double middle = south_ + side_ * mesh_.v[triangle.k[0]] / kMaxUv;
  const bool is_small = triangle.longest < kSmall && std::abs(middle) < 90 - kFromPole;
  constexpr double kPerMetre = 180 / (std::numbers::pi * kRadius);
  const int steps = is_small ? 1 : 8;
  constexpr double kSlack = 1e-3;
  double bulge = is_small ? 4 * triangle.longest * triangle.longest / kRadius * kPerMetre / side_ * kMaxUv : 0;
  triangle.west = triangle.south = kMaxUv;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t a = triangle.k[i], b = triangle.k[(i + 1) % 3];
    triangle.west = std::min<double>(triangle.west, mesh_.u[a]);
    triangle.east = std::max<double>(triangle.east, mesh_.u[a]);
    for (int step = 0; step < steps; ++step) {
      const double t = static_cast<double>(step) / steps;
      const double linear = mesh_.v[a] + t * (mesh_.v[b] - mesh_.v[a]);
      const double v =
          step == 0 ? linear : (LatitudeOf(ecef_[a] + (ecef_[b] - ecef_[a]) * t) - south_) / side_ * kMaxUv;
      bulge = std::max(bulge, std::abs(v - linear));
      triangle.south = std::min(triangle.south, v);
      triangle.north = std::max(triangle.north, v);
    }
  }
  triangle.west -= kSlack, triangle.east += kSlack;
  triangle.south -= bulge / 4 + kSlack, triangle.north += bulge / 4 + kSlack;
}

double TileSurface::ErrorAt(const Sample& sample) const {
  double longitude = sample.longitude - west_;
  longitude -= 360 * std::floor(longitude / 360);
  const double u = longitude / side_ * kMaxUv, v = (sample.latitude - south_) / side_ * kMaxUv;
  if (!(u >= 0 && u <= kMaxUv && v >= 0 && v <= kMaxUv)) return -1;
  const geo::Vec3 up = UpAt(sample.longitude, sample.latitude), foot = FootAt(up);
  double error = -1;
  for (const std::size_t t : bins_[static_cast<std::size_t>(BinOf(v) * bins_per_side_ + BinOf(u))]) {
    const Triangle& triangle = triangles_[t];
    if (u < triangle.west || u > triangle.east || v < triangle.south || v > triangle.north) continue;
    const auto& k = triangle.k;
    const auto cross = [&](std::size_t a, std::size_t b) {
      return (mesh_.u[k[a]] - u) * (mesh_.v[k[b]] - v) - (mesh_.v[k[a]] - v) * (mesh_.u[k[b]] - u);
    };
    const double w0 = cross(1, 2), w1 = cross(2, 0), w2 = cross(0, 1), sum = w0 + w1 + w2;
    if (w0 >= 0 && w1 >= 0 && w2 >= 0 && sum > 0) {
      const double sampled = (w0 * HeightOf(k[0]) + w1 * HeightOf(k[1]) + w2 * HeightOf(k[2])) / sum;
      error = std::max(error, std::abs(sampled - sample.height));
    }
    // foot + height * up is in the plane. A vertical triangle has no height, and one with two corners at a pole is a
    // line.
    const double across = geo::Dot(up, triangle.normal);
    if (geo::Length(triangle.normal) <= 1e-6 * triangle.longest) continue;
    if (std::abs(across) <= 1e-5 * geo::Length(triangle.normal)) continue;
    const auto side = [&](std::size_t a, std::size_t b) {
      return geo::Dot(up, geo::Cross(ecef_[k[a]] - foot, ecef_[k[b]] - foot)) * (across < 0 ? -1 : 1);
    };
    const double beside = -1e-8 * triangle.longest;  // a hundredth of a micrometre: the last bits of positions
    if (side(0, 1) < beside || side(1, 2) < beside || side(2, 0) < beside) continue;
    const double drawn = geo::Dot(ecef_[k[0]] - foot, triangle.normal) / across;
    error = std::max(error, std::abs(drawn - sample.height));
  }
  return error;
}

double TileSurface::LargestError(const SampleIndex& samples) const {
  double largest = -1;
  samples.ForEach(west_, south_, west_ + side_, south_ + side_,
                  [&](const Sample& sample) { largest = std::max(largest, ErrorAt(sample)); });
  return largest;
}

int TileSurface::BinOf(double at) const {
  return static_cast<int>(std::clamp(std::floor(at * bins_per_side_ / (kMaxUv + 1)), 0.0, bins_per_side_ - 1.0));
}

double TileSurface::HeightOf(std::size_t k) const {
  return double{mesh_.min_height} + (double{mesh_.max_height} - double{mesh_.min_height}) * mesh_.h[k] / kMaxUv;
}

}  // namespace terrace::tiler
