#include "proto/mesh/tile_normals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/geo/ellipsoid.h"
#include "proto/mesh/quantize_tile.h"
#include "proto/mesh/tile_geometry.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::proto {
namespace {

constexpr int kCells = 32;

struct SampledGround {
  geo::TileKey key;
  geo::Lattice lattice;
  std::vector<float> heights;

  SampledGround(geo::TileKey tile, const std::function<double(int, int)>& height)
      : key(tile), lattice{tile.level, kCells} {
    for (int j = -1; j <= kCells + 1; ++j) {
      for (int i = -1; i <= kCells + 1; ++i) heights.push_back(static_cast<float>(height(i, j)));
    }
  }
  TileSamples view() const { return {key, lattice, heights}; }
};

// The four corners and one sample inside.
tin::TinMesh Fan(std::uint16_t x, std::uint16_t y) {
  return {{{0, 0}, {kCells, 0}, {kCells, kCells}, {0, kCells}, {x, y}}, {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}};
}

std::vector<geo::Vec3> NormalsOf(const SampledGround& ground, const tin::TinMesh& mesh) {
  const EdgeSteps steps{{1, 1, 1, 1}, {1, 1, 1, 1}};
  std::vector<geo::Vec3> normals;
  for (const auto& [x, y] :
       TileNormals(ground.view(), mesh, DecodePositions(QuantizeTile(ground.view(), mesh, steps)))) {
    const auto [nx, ny, nz] = DecodeOctNormal(x, y);
    normals.push_back({nx, ny, nz});
  }
  return normals;
}

double DegreesBetween(geo::Vec3 a, geo::Vec3 b) {
  return geo::ToDegrees(std::atan2(geo::Length(geo::Cross(a, b)), geo::Dot(a, b)));
}

TEST(TileNormals, PointUpOnLevelGround) {
  const SampledGround ground({13, 8700, 6200}, [](int, int) { return 250; });
  const auto normals = NormalsOf(ground, Fan(16, 16));
  EXPECT_LT(DegreesBetween(normals[4], geo::SurfaceNormal(ground.view().Longitude(16), ground.view().Latitude(16))),
            1.2);
}

TEST(TileNormals, LeanAwayFromTheRise) {
  const geo::TileKey key{13, 8192, 4096};  // at the equator and Greenwich: east is +y, up is +x
  const geo::Lattice lattice{key.level, kCells};
  const double metres = lattice.StepDegrees() * geo::MetresPerDegreeEast(0);
  const tin::TinMesh mesh = Fan(16, 16);
  const auto normals = NormalsOf(SampledGround(key, [&](int i, int) { return i * metres; }), mesh);
  ASSERT_EQ(normals.size(), mesh.vertices.size());
  for (const geo::Vec3 normal : normals) {
    EXPECT_NEAR(normal.x, std::sqrt(0.5), 0.02);
    EXPECT_NEAR(normal.y, -std::sqrt(0.5), 0.02);
    EXPECT_NEAR(normal.z, 0, 0.02);
  }
}

TEST(TileNormals, AreEqualOnBothSidesOfAnEdge) {
  const auto height = [](std::int64_t column, std::int64_t row) {
    return 300 * std::sin(static_cast<double>(column) * 0.7) + 200 * std::cos(static_cast<double>(row) * 0.4);
  };
  const geo::TileKey west{12, 4300, 2900}, east{12, 4301, 2900};
  const auto ground_of = [&](const geo::TileKey& key) {
    return SampledGround(key, [&height, key](int i, int j) { return height(key.x * kCells + i, key.y * kCells + j); });
  };
  // Different inner vertices, the same edge.
  const tin::TinMesh left = Fan(9, 20), right = Fan(27, 3);
  const SampledGround a = ground_of(west), b = ground_of(east);
  const EdgeSteps steps{{1, 1, 1, 1}, {1, 1, 1, 1}};
  const auto of_west = TileNormals(a.view(), left, DecodePositions(QuantizeTile(a.view(), left, steps)));
  const auto of_east = TileNormals(b.view(), right, DecodePositions(QuantizeTile(b.view(), right, steps)));
  EXPECT_EQ(of_west[1], of_east[0]);
  EXPECT_EQ(of_west[2], of_east[3]);
}

// A single spike: the lattice's gradient is level beside its top, but the mesh is steep there.
TEST(TileNormals, StayNearTheMeshInside) {
  const geo::TileKey key{13, 8192, 4096};
  const SampledGround ground(key, [](int i, int j) { return i == 17 && j == 16 ? 2000 : 0; });
  const tin::TinMesh mesh = Fan(16, 16);  // the mesh has no spike: level
  const auto normals = NormalsOf(ground, mesh);
  const geo::Vec3 up = geo::SurfaceNormal(ground.view().Longitude(16), ground.view().Latitude(16));
  EXPECT_LT(DegreesBetween(normals[4], up), 14.5);
  EXPECT_GT(DegreesBetween(normals[4], up), 11);
}

// A cliff one step wide, across a corner: in both directions the normals of level ground at its top and foot are level.
// A slope of two steps counts as a slope.
TEST(TileNormals, OnEdgesACliffIsNoSlope) {
  const geo::TileKey key{13, 8192, 4096};
  constexpr double kCliff = 3000;
  for (const bool is_along_x : {true, false}) {
    for (const int end : {-1, 0, 1, 2}) {  // where the ground is level again
      const SampledGround ground(key, [&](int i, int j) { return (is_along_x ? i : j) < end ? kCliff : 0; });
      const auto normals = NormalsOf(ground, Fan(16, 16));
      const geo::Vec3 up = geo::SurfaceNormal(ground.view().Longitude(0), ground.view().Latitude(0));
      EXPECT_LT(DegreesBetween(normals[0], up), 14.5) << is_along_x << ' ' << end;
    }
    const SampledGround slope(key, [&](int i, int j) { return -kCliff * std::clamp(is_along_x ? i : j, -1, 1); });
    const geo::Vec3 up = geo::SurfaceNormal(slope.view().Longitude(0), slope.view().Latitude(0));
    EXPECT_GT(DegreesBetween(NormalsOf(slope, Fan(16, 16))[0], up), 80);
  }
}

TEST(TileNormals, AreTheEllipsoidsAtThePole) {
  const SampledGround ground({3, 5, 7}, [](int i, int j) { return 100 * i + 37 * j; });
  const auto normals = NormalsOf(ground, Fan(16, 16));
  EXPECT_LT(DegreesBetween(normals[2], {0, 0, 1}), 1.2);
  EXPECT_LT(DegreesBetween(normals[3], {0, 0, 1}), 1.2);
}

TEST(TileNormals, NeverPointIntoTheGround) {
  const SampledGround ground({18, 140000, 200000}, [](int i, int j) { return (i + j) % 2 == 0 ? 8000 : -8000; });
  const tin::TinMesh mesh = Fan(15, 16);
  const auto normals = NormalsOf(ground, mesh);
  ASSERT_EQ(normals.size(), mesh.vertices.size());
  for (std::size_t k = 0; k < normals.size(); ++k) {
    const tin::SamplePosition p = mesh.vertices[k];
    EXPECT_GT(geo::Dot(normals[k], geo::SurfaceNormal(ground.view().Longitude(p.x), ground.view().Latitude(p.y))), 0);
  }
}

}  // namespace
}  // namespace terrace::proto
