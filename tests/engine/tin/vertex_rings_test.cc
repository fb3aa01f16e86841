#include "engine/tin/decimate/vertex_rings.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

namespace terrace::tin {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

std::vector<std::uint32_t> RingOf(const VertexRings& rings, std::uint32_t vertex) {
  const auto ring = rings.Of(vertex);
  return {ring.begin(), ring.end()};
}

// A square with corners 0 to 3 and vertex 4 in the middle.
const TinMesh kSquare = {{{0, 0}, {4, 0}, {4, 4}, {0, 4}, {2, 2}}, {{2, 3, 4}, {4, 0, 1}, {1, 2, 4}, {3, 0, 4}}};

TEST(VertexRings, RunCounterClockwise) {
  const VertexRings rings(kSquare);
  EXPECT_EQ(RingOf(rings, 4), (std::vector<std::uint32_t>{0, 1, 2, 3}));
  EXPECT_EQ(RingOf(rings, 0), (std::vector<std::uint32_t>{1, 4, 3}));
  EXPECT_EQ(RingOf(rings, 2), (std::vector<std::uint32_t>{3, 4, 1}));
}

TEST(VertexRings, ListTheTrianglesByTheirSmallestVertex) {
  EXPECT_EQ(VertexRings(kSquare).Triangles(), (Triangles{{0, 1, 4}, {0, 4, 3}, {1, 2, 4}, {2, 3, 4}}));
}

TEST(VertexRings, FillAHoleWithAFan) {
  VertexRings rings(kSquare);
  rings.Remove(4, 1);
  EXPECT_TRUE(rings.Of(4).empty());
  EXPECT_EQ(RingOf(rings, 1), (std::vector<std::uint32_t>{2, 3, 0}));
  EXPECT_EQ(RingOf(rings, 3), (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(RingOf(rings, 0), (std::vector<std::uint32_t>{1, 3}));
  EXPECT_EQ(rings.Triangles(), (Triangles{{0, 1, 3}, {1, 2, 3}}));
}

TEST(VertexRings, GrowWhereAFanIsWide) {
  // A wheel of 12 around vertex 12: the fan from 0 gives it nine more neighbours.
  TinMesh wheel;
  for (std::uint16_t i = 0; i < 13; ++i) wheel.vertices.push_back({i, i});  // rings do not use positions
  for (std::uint32_t i = 0; i < 12; ++i) wheel.triangles.push_back({12, i, (i + 1) % 12});
  VertexRings rings(wheel);
  rings.Remove(12, 0);
  Triangles fan;
  for (std::uint32_t i = 1; i < 11; ++i) fan.push_back({0, i, i + 1});
  EXPECT_EQ(rings.Triangles(), fan);
}

}  // namespace
}  // namespace terrace::tin
