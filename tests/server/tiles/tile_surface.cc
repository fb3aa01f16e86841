#include "tests/server/tiles/tile_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace terrace::server {
namespace {

constexpr double kMost = 32767;  // u and v at the eastern and the northern edge

// Degrees, of the place whose plumb line passes through a point.
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

TileSurface::TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key) : mesh_(mesh), bins_(kBins * kBins) {
  side_ = 180.0 / static_cast<double>(geo::TileRows(key.level));
  west_ = side_ * static_cast<double>(key.x) - 180;
  south_ = side_ * static_cast<double>(key.y) - 90;
  for (std::size_t k = 0; k < mesh.u.size(); ++k) {
    ecef_.push_back(geo::ToEcef(west_ + side_ * mesh.u[k] / kMost, south_ + side_ * mesh.v[k] / kMost, HeightOf(k)));
  }
  for (const auto& corners : mesh.triangles) AddTriangle(corners);
}

void TileSurface::AddTriangle(const std::array<std::uint32_t, 3>& corners) {
  Triangle triangle;
  int low = 32767, high = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    triangle.k[i] = corners[i];
    low = std::min(low, mesh_.u[corners[i]]), high = std::max(high, mesh_.u[corners[i]]);
  }
  const geo::Vec3 &a = ecef_[corners[0]], &b = ecef_[corners[1]], &c = ecef_[corners[2]];
  triangle.normal = geo::Cross(b - a, c - a);
  triangle.longest = std::max({geo::Length(b - a), geo::Length(c - a), geo::Length(c - b)});
  const auto [south, north] = RowsOf(triangle);
  // Between the meridians of the corners: a wedge is convex.
  for (int v = BinOf(south); v <= BinOf(north); ++v) {
    for (int u = BinOf(low); u <= BinOf(high); ++u) {
      bins_[static_cast<std::size_t>(v * kBins + u)].push_back(triangles_.size());
    }
  }
  triangles_.push_back(triangle);
}

// In steps of v, of all plumb lines that may pass through the triangle: chords bulge towards the pole.
std::array<double, 2> TileSurface::RowsOf(const Triangle& triangle) const {
  constexpr int kSteps = 8;
  double low = kMost, high = 0, bulge = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t a = triangle.k[i], b = triangle.k[(i + 1) % 3];
    for (int step = 0; step < kSteps; ++step) {
      const double t = static_cast<double>(step) / kSteps;
      const double linear = mesh_.v[a] + t * (mesh_.v[b] - mesh_.v[a]);
      const double v = step == 0 ? linear : (LatitudeOf(ecef_[a] + (ecef_[b] - ecef_[a]) * t) - south_) / side_ * kMost;
      bulge = std::max(bulge, std::abs(v - linear));
      low = std::min(low, v), high = std::max(high, v);
    }
  }
  return {low - bulge / 4 - 1e-3, high + bulge / 4 + 1e-3};
}

double TileSurface::ErrorAt(const Sample& sample) const {
  double longitude = sample.longitude - west_;
  longitude -= 360 * std::floor(longitude / 360);
  const double u = longitude / side_ * kMost, v = (sample.latitude - south_) / side_ * kMost;
  if (!(u >= 0 && u <= kMost && v >= 0 && v <= kMost)) return -1;
  const geo::Vec3 foot = geo::ToEcef(sample.longitude, sample.latitude, 0);
  const geo::Vec3 up = geo::SurfaceNormal(sample.longitude, sample.latitude);
  double error = -1;
  for (const std::size_t t : bins_[static_cast<std::size_t>(BinOf(v) * kBins + BinOf(u))]) {
    const Triangle& triangle = triangles_[t];
    const auto& k = triangle.k;
    const auto cross = [&](std::size_t a, std::size_t b) {
      return (mesh_.u[k[a]] - u) * (mesh_.v[k[b]] - v) - (mesh_.v[k[a]] - v) * (mesh_.u[k[b]] - u);
    };
    const double w0 = cross(1, 2), w1 = cross(2, 0), w2 = cross(0, 1), sum = w0 + w1 + w2;
    if (w0 >= 0 && w1 >= 0 && w2 >= 0 && sum > 0) {
      const double sampled = (w0 * HeightOf(k[0]) + w1 * HeightOf(k[1]) + w2 * HeightOf(k[2])) / sum;
      error = std::max(error, std::abs(sampled - sample.height));
    }
    // foot + height * up lies in the plane. One that stands upright tells no height.
    const double across = geo::Dot(up, triangle.normal);
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

int TileSurface::BinOf(double at) {
  return static_cast<int>(std::clamp(std::floor(at * kBins / 32768), 0.0, kBins - 1.0));
}

double TileSurface::HeightOf(std::size_t k) const {
  return double{mesh_.min_height} + (double{mesh_.max_height} - double{mesh_.min_height}) * mesh_.h[k] / kMost;
}

}  // namespace terrace::server
