#include "engine/tin/mesh/triangulation.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <vector>

#include "engine/tin/mesh/predicates.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

Triangulation MakeTriangulation(int width, int height) {
  const auto east = static_cast<std::uint16_t>(width - 1), north = static_cast<std::uint16_t>(height - 1);
  return Triangulation({{{{0, 0}, 0}, {{east, 0}, 1}, {{east, north}, 2}, {{0, north}, 3}}});
}

const Star& Insert(Triangulation& triangulation, SamplePosition point, TriangleId t) {
  return triangulation.InsertDelaunay({point, static_cast<float>(point.x + 10 * point.y)}, t);
}

testing::AssertionResult TwinsAgree(const Triangulation& triangulation) {
  for (HalfEdgeId edge = 0; edge < 4 * triangulation.triangle_count(); ++edge) {
    if (edge % 4 == 3) continue;
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
  const Triangulation triangulation = MakeTriangulation(5, 3);
  EXPECT_EQ(triangulation.vertex_count(), 4u);
  EXPECT_EQ(triangulation.triangle_count(), 2u);
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(NoiseField(5, 3, 1), triangulation.Mesh()));
}

TEST(Triangulation, SplitsTrianglesInteriorEdgesAndBorderEdges) {
  const HeightField field = NoiseField(9, 9, 1);
  Triangulation triangulation = MakeTriangulation(9, 9);
  Insert(triangulation, {6, 2}, 0);
  EXPECT_EQ(triangulation.triangle_count(), 4u);
  Insert(triangulation, {4, 0}, triangulation.Locate({4, 0}, 0));
  EXPECT_EQ(triangulation.triangle_count(), 5u);
  Insert(triangulation, {4, 4}, triangulation.Locate({4, 4}, 0));
  EXPECT_EQ(triangulation.triangle_count(), 7u);
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(field, triangulation.Mesh()));
  EXPECT_TRUE(IsDelaunay(triangulation.Mesh()));
}

TEST(Triangulation, IsDelaunayAfterEveryInsertionOfEverySample) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const int width = 2 + random.Below(9), height = 2 + random.Below(9);
    const HeightField field = NoiseField(width, height, seed);
    Triangulation triangulation = MakeTriangulation(width, height);
    for (int i = 0; i < 10 * width * height; ++i) {
      const SamplePosition p{static_cast<std::uint16_t>(random.Below(width)),
                             static_cast<std::uint16_t>(random.Below(height))};
      const TriangleId t = triangulation.Locate(
          p, static_cast<TriangleId>(random.Below(static_cast<int>(triangulation.triangle_count()))));
      if (triangulation.IsCorner(p, t)) continue;
      Insert(triangulation, p, t);
      ASSERT_TRUE(TwinsAgree(triangulation));
      ASSERT_TRUE(CoversExactly(field, triangulation.Mesh()));
      ASSERT_TRUE(IsDelaunay(triangulation.Mesh()));
    }
  }
}

TEST(Triangulation, JudgesCirclesAsThePredicateDoesInTheLargestField) {
  Random random(5);
  constexpr std::uint16_t kLast = HeightField::kMaxSide - 1;
  const auto coordinate = [&]() -> std::uint16_t {
    switch (random.Below(4)) {
      case 0:
        return 0;
      case 1:
        return kLast;
      case 2:
        return static_cast<std::uint16_t>(random.Below(4));
      default:
        return static_cast<std::uint16_t>(random.Below(HeightField::kMaxSide));
    }
  };
  int inside = 0;
  for (int i = 0; i < 100000; ++i) {
    std::array<SamplePosition, 4> at;
    for (SamplePosition& position : at) position = {coordinate(), coordinate()};
    const auto [v, u, w, p] = at;
    const auto seen = [p = p](SamplePosition q) { return RingVertex{0, q.x - p.x, q.y - p.y, 0}; };
    const bool is_inside = InCircle(v, u, w, p) > 0;
    ASSERT_EQ(IsInsideCircle(seen(v), seen(u), seen(w)), is_inside) << i;
    inside += is_inside ? 1 : 0;
  }
  EXPECT_GT(inside, 10000);
}

TEST(Triangulation, ReturnsExactlyTheTrianglesAroundTheNewVertex) {
  Random random(7);
  Triangulation triangulation = MakeTriangulation(33, 21);
  for (int i = 0; i < 2000; ++i) {
    const SamplePosition p{static_cast<std::uint16_t>(random.Below(33)), static_cast<std::uint16_t>(random.Below(21))};
    const TriangleId t = triangulation.Locate(p, 0);
    if (triangulation.IsCorner(p, t)) continue;
    const TinMesh before = triangulation.Mesh();
    const Star& star = Insert(triangulation, p, t);
    const std::set<TriangleId> reported(star.triangles.begin(),
                                        star.triangles.begin() + static_cast<std::ptrdiff_t>(star.count));
    ASSERT_EQ(reported.size(), star.count);
    for (std::size_t k = 0; k < star.count; ++k) {
      const auto [u, v, centre] = triangulation.triangle(star.triangles[k]);
      ASSERT_EQ(u, star.ring.ids[k]);
      ASSERT_EQ(v, star.ring.ids[k + 1]);
      ASSERT_EQ(centre, star.centre);
      ASSERT_EQ(star.ring.dx[k], triangulation.position(u).x - p.x);
      ASSERT_EQ(star.ring.dy[k], triangulation.position(u).y - p.y);
      ASSERT_EQ(star.ring.heights[k], triangulation.height(u));
      ASSERT_EQ(triangulation.twin(4 * star.triangles[k]), star.outside[k]);
    }
    ASSERT_EQ(star.is_closed, star.ring.ids[0] == star.ring.ids[star.count]);
    const TinMesh after = triangulation.Mesh();
    for (TriangleId k = 0; k < after.triangles.size(); ++k) {
      const bool is_new = k >= before.triangles.size() || before.triangles[k] != after.triangles[k];
      ASSERT_EQ(is_new, reported.contains(k));
      ASSERT_EQ(is_new, triangulation.IsCorner(p, k));
    }
  }
}

TEST(Triangulation, LocatesEverySampleFromEverywhere) {
  Random random(3);
  Triangulation triangulation = MakeTriangulation(17, 17);
  for (int i = 0; i < 60; ++i) {
    const SamplePosition p{static_cast<std::uint16_t>(random.Below(17)), static_cast<std::uint16_t>(random.Below(17))};
    const TriangleId t = triangulation.Locate(p, 0);
    if (!triangulation.IsCorner(p, t)) Insert(triangulation, p, t);
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
  Triangulation triangulation = MakeTriangulation(kSide, kSide);
  for (int i = 0; i < 3000; ++i) {
    SamplePosition p{static_cast<std::uint16_t>(random.Below(kSide)), static_cast<std::uint16_t>(random.Below(kSide))};
    if (random.Below(4) == 0) p.x = static_cast<std::uint16_t>(random.Below(2) * (kSide - 1));
    const TriangleId t = triangulation.Locate(p, static_cast<TriangleId>(triangulation.triangle_count() - 1));
    if (!triangulation.IsCorner(p, t)) Insert(triangulation, p, t);
  }
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(IsDelaunay(triangulation.Mesh()));
}

TEST(Triangulation, WidensWhenItsVerticesOutgrowSixteenBits) {
  constexpr int kSide = 260;
  Triangulation triangulation = MakeTriangulation(kSide, kSide);
  TriangleId near = 0;
  for (std::uint16_t y = 0; y < kSide; ++y) {
    for (std::uint16_t x = 0; x < kSide; ++x) {
      near = triangulation.Locate({x, y}, near);
      if (!triangulation.IsCorner({x, y}, near)) near = Insert(triangulation, {x, y}, near).triangles[0];
    }
  }
  EXPECT_EQ(triangulation.vertex_count(), std::size_t{kSide} * kSide);
  EXPECT_EQ(triangulation.triangle_count(), std::size_t{2} * (kSide - 1) * (kSide - 1));
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(NoiseField(kSide, kSide, 1), triangulation.Mesh()));
}

TEST(Triangulation, FindsItsWayAroundAnyMesh) {
  Random random(5);
  const HeightField field = NoiseField(30, 20, 1);
  Triangulation triangulation = MakeTriangulation(30, 20);
  for (int i = 0; i < 150; ++i) {
    const SamplePosition p{static_cast<std::uint16_t>(random.Below(30)), static_cast<std::uint16_t>(random.Below(20))};
    const TriangleId t = triangulation.Locate(p, 0);
    if (triangulation.IsCorner(p, t)) continue;
    // A random criterion, which makes many slivers.
    triangulation.Insert({p, 0}, t, [&](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId) {
      return Cross(u, v) == 0 || (Sees(u, v, w) && random.Below(2) == 0);
    });
  }
  EXPECT_TRUE(TwinsAgree(triangulation));
  EXPECT_TRUE(CoversExactly(field, triangulation.Mesh()));
  std::vector<Triangulation::Vertex> vertices;
  for (VertexId v = 0; v < triangulation.vertex_count(); ++v) {
    vertices.push_back({triangulation.position(v), triangulation.height(v)});
  }
  const Triangulation joined(vertices, triangulation.Mesh().triangles);
  EXPECT_TRUE(TwinsAgree(joined));
  for (TriangleId t = 0; t < joined.triangle_count(); ++t) {
    for (HalfEdgeId edge = 4 * t; edge < 4 * t + 3; ++edge) EXPECT_EQ(joined.twin(edge), triangulation.twin(edge));
  }
  for (std::uint16_t y = 0; y < 20; ++y) {
    for (std::uint16_t x = 0; x < 30; ++x) {
      const auto [a, b, c] = joined.triangle(joined.Locate({x, y}, 0));
      ASSERT_TRUE(Orientation(joined.position(a), joined.position(b), {x, y}) >= 0 &&
                  Orientation(joined.position(b), joined.position(c), {x, y}) >= 0 &&
                  Orientation(joined.position(c), joined.position(a), {x, y}) >= 0);
    }
  }
}

TEST(TriangulationDeathTest, RefusesAPointOutsideTheTriangle) {
  Triangulation triangulation = MakeTriangulation(9, 9);
  EXPECT_DEATH(Insert(triangulation, {1, 7}, 0), "check failed");
  EXPECT_DEATH(Insert(triangulation, {8, 8}, 0), "check failed");
}

}  // namespace
}  // namespace terrace::tin
