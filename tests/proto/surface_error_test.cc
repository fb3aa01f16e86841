#include "proto/error/surface_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "proto/error/tile_error.h"
#include "proto/mesh/quantize_tile.h"
#include "proto/mesh/tile_geometry.h"
#include "tests/proto/ground.h"

namespace terrace::proto {
namespace {

// Bilinear between the four samples around a position.
double LatticeHeight(const TileSamples& samples, double x, double y) {
  const int i = std::min(static_cast<int>(x), samples.cells() - 1),
            j = std::min(static_cast<int>(y), samples.cells() - 1);
  x -= i, y -= j;
  return (1 - x) * (1 - y) * samples.At(i, j) + x * (1 - y) * samples.At(i + 1, j) +
         (1 - x) * y * samples.At(i, j + 1) + x * y * samples.At(i + 1, j + 1);
}

// The foot of a point's plumb line on the ellipsoid in lattice steps, and the height above it in metres. Computed by
// repeated substitution into the definition of geodetic latitude.
struct Foot {
  double x = 0, y = 0, height = 0;
};
Foot FootOf(const TileSamples& samples, const geo::Vec3& point, double near_x) {
  const double radius = std::hypot(point.x, point.y), step = geo::ToRadians(samples.lattice.StepDegrees());
  double latitude = std::atan2(point.z, radius);
  for (int k = 0; k < 9; ++k) {
    const double sine = std::sin(latitude);
    const double normal = geo::kSemiMajorAxis / std::sqrt(1 - geo::kEccentricitySquared * sine * sine);
    latitude = std::atan2(point.z + geo::kEccentricitySquared * normal * sine, radius);
  }
  const double longitude = std::atan2(point.y, point.x) - geo::ToRadians(samples.Longitude(0));
  const double turn = 2 * std::numbers::pi, near = near_x * step;
  const double turned = longitude - std::round((longitude - near) / turn) * turn;
  const double degrees = geo::ToDegrees(latitude);
  const geo::Vec3 up = geo::SurfaceNormal(geo::ToDegrees(std::atan2(point.y, point.x)), degrees);
  const geo::Vec3 on = geo::ToEcef(geo::ToDegrees(std::atan2(point.y, point.x)), degrees, 0);
  return {turned / step, (latitude - geo::ToRadians(samples.Latitude(0))) / step, geo::Dot(point - on, up)};
}

struct Largest {
  double planar = 0, drawn = 0;
};

// Compares many points of every triangle and of its rim with the lattice surface.
Largest Sampled(const TileSamples& samples, const std::vector<std::array<double, 2>>& places,
                const std::vector<double>& heights, const std::vector<geo::Vec3>& ecef,
                const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  constexpr int kSteps = 24;
  Largest largest;
  for (const auto& t : triangles) {
    for (int a = 0; a <= kSteps; ++a) {
      for (int b = 0; a + b <= kSteps; ++b) {
        const double u = double(a) / kSteps, v = double(b) / kSteps, w = 1 - u - v;
        const double x = u * places[t[0]][0] + v * places[t[1]][0] + w * places[t[2]][0];
        const double y = u * places[t[0]][1] + v * places[t[1]][1] + w * places[t[2]][1];
        const double ground = LatticeHeight(samples, x, y);
        if (!heights.empty()) {
          const double height = u * heights[t[0]] + v * heights[t[1]] + w * heights[t[2]];
          largest.planar = std::max(largest.planar, std::abs(height - ground));
        }
        const geo::Vec3 point = ecef[t[0]] * u + ecef[t[1]] * v + ecef[t[2]] * w;
        const Foot foot = FootOf(samples, point, x);
        if (foot.x < 0 || foot.y < 0 || foot.x > samples.cells() || foot.y > samples.cells()) continue;
        largest.drawn = std::max(largest.drawn, std::abs(foot.height - LatticeHeight(samples, foot.x, foot.y)));
      }
    }
  }
  return largest;
}

constexpr EdgeSteps kFineSteps{{0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}, {0x1p-6, 0x1p-6, 0x1p-6, 0x1p-6}};

Largest SampledTile(const TileSamples& samples, const QuantizedTile& tile) {
  std::vector<std::array<double, 2>> places;
  std::vector<double> heights;
  for (std::size_t k = 0; k < tile.u.size(); ++k) {
    places.push_back(
        {double(tile.u[k]) * samples.cells() / kQuantizedMax, double(tile.v[k]) * samples.cells() / kQuantizedMax});
    heights.push_back(HeightAt(tile, tile.h[k]));
  }
  return Sampled(samples, places, heights, DecodePositions(tile), tile.triangles);
}

// If the surface is a saddle inside a cell, the largest error on an edge is neither at a sample nor at a crossing.
TEST(SurfaceError, IsReachedAndNeverPassedAtAnyPlaceOfTheTile) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const RandomGround ground({12, 3000, 2000}, 32, 300, seed);
    const tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_points = 4 + seed * 20});
    const QuantizedTile tile = QuantizeTile(ground.view(), mesh, kFineSteps);
    const double at_samples = TileErrorMeter(ground.view(), 1e9).Measure(tile).max_m;
    const double measured = MeasureSurfaceError(ground.view(), tile, DecodePositions(tile), at_samples);
    const Largest sampled = SampledTile(ground.view(), tile);
    EXPECT_GE(measured, sampled.planar);
    EXPECT_GE(measured, sampled.drawn);
    EXPECT_LE(measured, sampled.planar * 1.06 + 0.5) << seed;
  }
}

TEST(SurfaceError, HoldsBetweenSamplesOnNoiseThatSamplesCannotShow) {
  // All samples are on the mesh except those of one cell's diagonal, so the measured error is between samples.
  RandomGround ground({12, 3000, 2000}, 32, 0, 1);
  const auto set = [&](int i, int j, float height) {
    ground.heights[static_cast<std::size_t>(j + 1) * 35 + static_cast<std::size_t>(i + 1)] = height;
  };
  set(10, 10, 100);
  set(11, 11, 100);
  tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_points = 200});
  const QuantizedTile tile = QuantizeTile(ground.view(), mesh, kFineSteps);
  ASSERT_LT(TileErrorMeter(ground.view(), 1e9).Measure(tile).max_m, 1);
  EXPECT_GE(MeasureSurfaceError(ground.view(), tile, DecodePositions(tile), 0),
            SampledTile(ground.view(), tile).planar);
}

TEST(SurfaceError, BoundsFlatTrianglesFromTheWholeEarthToAStreet) {
  for (const int level : {0, 5, 10, 14}) {
    for (const double latitude : {-90.0, -40.0, 0.0, 75.0}) {
      const std::int64_t row = std::clamp<std::int64_t>(
          static_cast<std::int64_t>((latitude + 90) / 180 * static_cast<double>(geo::TileRows(level))), 0,
          geo::TileRows(level) - 1);
      const RandomGround ground({level, geo::TileColumns(level) / 3, row}, 64, 20000.0 / (1 << level), 7);
      const tin::TinMesh mesh = GreedyMesh(ground.view(), {.max_points = 600});
      const QuantizedTile tile = QuantizeTile(ground.view(), mesh, kFineSteps);
      const double at_samples = TileErrorMeter(ground.view(), 1e9).Measure(tile).max_m;
      const double measured = MeasureSurfaceError(ground.view(), tile, DecodePositions(tile), at_samples);
      const Largest sampled = SampledTile(ground.view(), tile);
      EXPECT_GE(measured, std::max(sampled.drawn, sampled.planar)) << level << " " << latitude;
      // The term for the curvature between samples decreases with the square of the cell size.
      const double cell = 180.0 / 64 / (1 << level) * 111320;
      EXPECT_LE(measured, std::max(sampled.drawn, sampled.planar) * 1.2 + 2 * cell * cell / 6.3e6 + 0.5) << level;

      std::vector<std::array<double, 2>> places;
      std::vector<geo::Vec3> positions;
      for (const tin::SamplePosition p : mesh.vertices) {
        places.push_back({double(p.x), double(p.y)});
        positions.push_back(
            geo::ToEcef(ground.view().Longitude(p.x), ground.view().Latitude(p.y), ground.view().At(p.x, p.y)));
      }
      const double flat = MeasureFlatSurfaceError(
          ground.view(), mesh, positions, TileErrorMeter(ground.view(), 1e9).MeasureFlat(mesh, positions).max_m);
      EXPECT_GE(flat, Sampled(ground.view(), places, {}, positions, mesh.triangles).drawn) << level << " " << latitude;
    }
  }
}

}  // namespace
}  // namespace terrace::proto
