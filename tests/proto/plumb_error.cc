#include "tests/proto/plumb_error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace terrace::proto {
namespace {

// The plumb line is further from the first corner than both other corners are.
bool IsFarFrom(const geo::Vec3& foot, const geo::Vec3& up, const geo::Vec3& a, const geo::Vec3& b, const geo::Vec3& c) {
  return geo::Length(geo::Cross(a - foot, up)) > std::max(geo::Length(b - a), geo::Length(c - a)) * 1.01 + 1;
}

// Triangles that may be near a plumb line of a block of nodes. The margin is the largest difference of the block's feet
// and directions from those of its middle node. Testing all nodes against every triangle would take minutes.
std::vector<std::size_t> NearBlock(const TileSamples& samples, int west, int south, int side,
                                   const std::vector<geo::Vec3>& ecef,
                                   const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const int east = std::min(west + side - 1, samples.cells()), north = std::min(south + side - 1, samples.cells());
  const double x = samples.Longitude((west + east) / 2), y = samples.Latitude((south + north) / 2);
  const geo::Vec3 foot = geo::ToEcef(x, y, 0), up = geo::SurfaceNormal(x, y);
  double apart = 0, turned = 0;
  for (int j = south; j <= north; ++j) {
    for (int i = west; i <= east; ++i) {
      apart = std::max(apart, geo::Length(geo::ToEcef(samples.Longitude(i), samples.Latitude(j), 0) - foot));
      turned = std::max(turned, geo::Length(geo::SurfaceNormal(samples.Longitude(i), samples.Latitude(j)) - up));
    }
  }
  std::vector<std::size_t> near;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const geo::Vec3 &a = ecef[triangles[t][0]], &b = ecef[triangles[t][1]], &c = ecef[triangles[t][2]];
    const double reach = std::max(geo::Length(b - a), geo::Length(c - a)) * 1.01 + 1;
    const double more = apart + (geo::Length(a - foot) + apart) * turned;
    if (geo::Length(geo::Cross(a - foot, up)) <= reach + more) near.push_back(t);
  }
  return near;
}

}  // namespace

FlatError LargestFlatError(const TileSamples& samples, const std::vector<geo::Vec3>& ecef,
                           const std::vector<std::array<std::uint32_t, 3>>& triangles, int margin) {
  using Vector = std::array<long double, 3>;
  const auto minus = [](const geo::Vec3& a, const geo::Vec3& b) {
    return Vector{static_cast<long double>(a.x) - b.x, static_cast<long double>(a.y) - b.y,
                  static_cast<long double>(a.z) - b.z};
  };
  const auto determinant = [](const Vector& a, const Vector& b, const Vector& c) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  };
  const auto length = [](const Vector& a) { return std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]); };
  FlatError largest;
  constexpr int kBlock = 8;
  std::vector<std::vector<std::size_t>> near;  // for a row of blocks
  for (int j = 0; j <= samples.cells(); ++j) {
    if (j % kBlock == 0) {
      near.clear();
      for (int i = 0; i <= samples.cells(); i += kBlock) {
        near.push_back(NearBlock(samples, i, j, kBlock, ecef, triangles));
      }
    }
    if (j < margin || j > samples.cells() - margin) continue;
    for (int i = margin; i <= samples.cells() - margin; ++i) {
      const geo::Vec3 foot = geo::ToEcef(samples.Longitude(i), samples.Latitude(j), 0);
      const geo::Vec3 normal = geo::SurfaceNormal(samples.Longitude(i), samples.Latitude(j));
      const Vector down = {-normal.x, -normal.y, -normal.z};
      for (const std::size_t index : near[static_cast<std::size_t>(i / kBlock)]) {
        const auto& t = triangles[index];
        if (IsFarFrom(foot, normal, ecef[t[0]], ecef[t[1]], ecef[t[2]])) continue;
        // foot + height up = a + u (b - a) + v (c - a)
        const Vector ab = minus(ecef[t[1]], ecef[t[0]]), ac = minus(ecef[t[2]], ecef[t[0]]);
        const Vector bc = minus(ecef[t[2]], ecef[t[1]]), to_foot = minus(foot, ecef[t[0]]);
        const long double all = determinant(ab, ac, down);
        const long double area =
            length({ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]});
        if (std::abs(all) <= 1e-5L * area) continue;
        const long double u = determinant(to_foot, ac, down) / all, v = determinant(ab, to_foot, down) / all;
        const long double beside = 2e-6L / std::abs(all);
        if (u < -beside * length(ac) || v < -beside * length(ab) || 1 - u - v < -beside * length(bc)) continue;
        const long double height = determinant(ab, ac, to_foot) / all;
        const auto error = static_cast<double>(std::abs(height - samples.At(i, j)));
        largest.most = std::max(largest.most, error);
        const bool is_inside = u > beside * length(ac) && v > beside * length(ab) && 1 - u - v > beside * length(bc);
        if (is_inside) largest.least = std::max(largest.least, error);
      }
    }
  }
  return largest;
}

}  // namespace terrace::proto
