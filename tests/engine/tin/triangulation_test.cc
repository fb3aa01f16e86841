#include "engine/tin/triangulation.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "engine/tin/predicates.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TinMesh MeshOf(const Triangulation& triangulation) {
  TinMesh mesh{triangulation.positions(), {}};
  for (TriangleId t = 0; t < triangulation.triangle_count(); ++t) mesh.triangles.push_back(triangulation.triangle(t));
  return mesh;
}

testing::AssertionResult TwinsAgree(const Triangulation& triangulation) {
  for (HalfEdgeId edge = 0; edge < 3 * triangulation.triangle_count(); ++edge) {
    const HalfEdgeId twin = triangulation.twin(edge);
    if (twin == Triangulation::kNone) continue;
    if (triangulation.twin(twin) != edge ||
        triangulation.corner(twin) != triangulation.corner(Triangulation::Next(edge)) ||
        triangulation.corner(edge) != triangulation.corner(Triangulation::Next(twin))) {
      return testing::AssertionFailure() << "half-edge " << edge << " and its twin " << twin;
    }
  }
  return testing::AssertionSuccess();
}

TEST(Triangulation, StartsWithTwoTriangles) {
  const Triangulation triangulation(5, 3);
  EXPECT_EQ(triangulation.vertex_count(), 4u);
  EXPECT_EQ(triangulation.triangle_count(), 2u);
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(NoiseField(5, 3, 1), MeshOf(triangulation)));
}

TEST(Triangulation, SplitsTrianglesInteriorEdgesAndBorderEdges) {
  const HeightField field = NoiseField(9, 9, 1);
  Triangulation triangulation(9, 9);
  triangulation.Insert({6, 2}, 0);
  EXPECT_EQ(triangulation.triangle_count(), 4u);
  triangulation.Insert({4, 0}, triangulation.Locate({4, 0}, 0));
  EXPECT_EQ(triangulation.triangle_count(), 5u);
  triangulation.Insert({4, 4}, triangulation.Locate({4, 4}, 0));
  EXPECT_EQ(triangulation.triangle_count(), 7u);
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(field, MeshOf(triangulation)));
  EXPECT_TRUE(IsDelaunay(MeshOf(triangulation)));
}

TEST(Triangulation, IsDelaunayAfterEveryInsertionOfEverySample) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const int width = 2 + random.Below(9), height = 2 + random.Below(9);
    const HeightField field = NoiseField(width, height, seed);
    Triangulation triangulation(width, height);
    for (int i = 0; i < 10 * width * height; ++i) {
      const SamplePosition p{static_cast<std::uint16_t>(random.Below(width)),
                             static_cast<std::uint16_t>(random.Below(height))};
      const TriangleId t = triangulation.Locate(
          p, static_cast<TriangleId>(random.Below(static_cast<int>(triangulation.triangle_count()))));
      if (triangulation.IsCorner(p, t)) continue;
      triangulation.Insert(p, t);
      ASSERT_TRUE(TwinsAgree(triangulation));
      ASSERT_TRUE(CoversExactly(field, MeshOf(triangulation)));
      ASSERT_TRUE(IsDelaunay(MeshOf(triangulation)));
    }
  }
}

TEST(Triangulation, ReturnsExactlyTheTrianglesAroundTheNewVertex) {
  Random random(7);
  Triangulation triangulation(33, 21);
  for (int i = 0; i < 2000; ++i) {
    const SamplePosition p{static_cast<std::uint16_t>(random.Below(33)), static_cast<std::uint16_t>(random.Below(21))};
    const TriangleId t = triangulation.Locate(p, 0);
    if (triangulation.IsCorner(p, t)) continue;
    const TinMesh before = MeshOf(triangulation);
    const auto changed = triangulation.Insert(p, t);
    const std::set<TriangleId> reported(changed.begin(), changed.end());
    ASSERT_EQ(reported.size(), changed.size());
    const TinMesh after = MeshOf(triangulation);
    for (TriangleId k = 0; k < after.triangles.size(); ++k) {
      const bool is_new = k >= before.triangles.size() || before.triangles[k] != after.triangles[k];
      ASSERT_EQ(is_new, reported.contains(k));
      ASSERT_EQ(is_new, triangulation.IsCorner(p, k));
    }
  }
}

TEST(Triangulation, LocatesEverySampleFromEverywhere) {
  Random random(3);
  Triangulation triangulation(17, 17);
  for (int i = 0; i < 60; ++i) {
    const SamplePosition p{static_cast<std::uint16_t>(random.Below(17)), static_cast<std::uint16_t>(random.Below(17))};
    const TriangleId t = triangulation.Locate(p, 0);
    if (!triangulation.IsCorner(p, t)) triangulation.Insert(p, t);
  }
  for (std::uint16_t y = 0; y < 17; ++y) {
    for (std::uint16_t x = 0; x < 17; ++x) {
      for (TriangleId start = 0; start < triangulation.triangle_count(); ++start) {
        const auto [a, b, c] = triangulation.triangle(triangulation.Locate({x, y}, start));
        const SamplePosition pa = triangulation.position(a), pb = triangulation.position(b),
                             pc = triangulation.position(c);
        ASSERT_TRUE(Orientation(pa, pb, {x, y}) >= 0 && Orientation(pb, pc, {x, y}) >= 0 &&
                    Orientation(pc, pa, {x, y}) >= 0);
      }
    }
  }
}

TEST(Triangulation, HoldsTheLargestField) {
  constexpr int kSide = HeightField::kMaxSide;
  Random random(11);
  Triangulation triangulation(kSide, kSide);
  for (int i = 0; i < 3000; ++i) {
    SamplePosition p{static_cast<std::uint16_t>(random.Below(kSide)), static_cast<std::uint16_t>(random.Below(kSide))};
    if (random.Below(4) == 0) p.x = static_cast<std::uint16_t>(random.Below(2) * (kSide - 1));
    const TriangleId t = triangulation.Locate(p, static_cast<TriangleId>(triangulation.triangle_count() - 1));
    if (!triangulation.IsCorner(p, t)) triangulation.Insert(p, t);
  }
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(IsDelaunay(MeshOf(triangulation)));
}

TEST(TriangulationDeathTest, RefusesAPointOutsideTheTriangle) {
  Triangulation triangulation(9, 9);
  EXPECT_DEATH(triangulation.Insert({1, 7}, 0), "check failed");
  EXPECT_DEATH(triangulation.Insert({8, 8}, 0), "check failed");
}

}  // namespace
}  // namespace terrace::tin
