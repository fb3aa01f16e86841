#include "proto/mesh/quantized_mesh.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "proto/mesh/tile_geometry.h"
#include "tests/proto/grid_tile.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::proto {
namespace {

constexpr TileExtensions kPlain{}, kWithNormals{.normals = true};

QuantizedTile SmallTile() {
  QuantizedTile tile;
  tile.key = {10, 1100, 700};
  tile.u = {0, 32767, 0, 32767};
  tile.v = {0, 0, 32767, 32767};
  tile.h = {0, 5, 32767, 100};
  tile.triangles = {{0, 1, 3}, {0, 3, 2}};
  tile.min_height = 12.5f;
  tile.max_height = 640.25f;
  tile.normals = {{1, 2}, {3, 4}, {5, 6}, {7, 8}};
  return tile;
}

DecodedTile Decoded(const std::string& bytes) {
  std::optional<DecodedTile> tile = DecodeQuantizedMesh(bytes);
  EXPECT_TRUE(tile.has_value());
  return tile.value_or(DecodedTile{});
}

std::string Hex(std::string_view bytes) {
  std::string hex;
  for (char byte : bytes) hex += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return hex;
}

using Corner = std::tuple<int, int, int>;

// The triangles as coordinates, independent of vertex numbers.
std::vector<std::array<Corner, 3>> Shape(const QuantizedTile& tile) {
  std::vector<std::array<Corner, 3>> shape;
  for (const auto& t : tile.triangles) {
    const auto corner = [&](std::uint32_t i) { return Corner(tile.u[i], tile.v[i], tile.h[i]); };
    shape.push_back({corner(t[0]), corner(t[1]), corner(t[2])});
  }
  return shape;
}

std::vector<std::array<Corner, 3>> Shape(const DecodedTile& tile) {
  std::vector<std::array<Corner, 3>> shape;
  for (const auto& t : tile.triangles) {
    const auto corner = [&](std::uint32_t i) { return Corner(tile.u[i], tile.v[i], tile.h[i]); };
    shape.push_back({corner(t[0]), corner(t[1]), corner(t[2])});
  }
  return shape;
}

void ExpectEdge(const DecodedTile& tile, const std::vector<std::uint32_t>& edge, const std::vector<int>& across,
                int value, const std::vector<int>& along) {
  const auto on_edge = std::count(across.begin(), across.end(), value);
  EXPECT_EQ(edge.size(), static_cast<std::size_t>(on_edge));
  for (std::size_t i = 0; i < edge.size(); ++i) {
    EXPECT_EQ(across[edge[i]], value);
    if (i > 0) {
      EXPECT_LT(along[edge[i - 1]], along[edge[i]]);
    }
  }
  EXPECT_EQ(along[edge.front()], 0);
  EXPECT_EQ(along[edge.back()], kQuantizedMax);
  EXPECT_LE(edge.size(), tile.u.size());
}

void ExpectCompleteEdges(const DecodedTile& tile) {
  ExpectEdge(tile, tile.west, tile.u, 0, tile.v);
  ExpectEdge(tile, tile.south, tile.v, 0, tile.u);
  ExpectEdge(tile, tile.east, tile.u, kQuantizedMax, tile.v);
  ExpectEdge(tile, tile.north, tile.v, kQuantizedMax, tile.u);
}

TEST(QuantizedMesh, TwoTrianglesAreTheseBytes) {
  const std::string expected =
      "78cd774e20d65341b68960c1d9f8324135ad82cacf724a41"  // centre
      "0000484100102044"                                  // lowest and highest height
      "78cd774e20d65341b68960c1d9f8324135ad82cacf724a41"  // sphere's centre
      "0445908422e6c840"                                  // sphere's radius
      "a89fa6be5c17ea3fe778616350f4c83f223ffe71df73e13f"  // horizon occlusion point
      "04000000"                                          // vertices
      "0000feff0000fdff"                                  // u
      "00000000feff0000"                                  // v
      "00000a00be0036ff"                                  // h
      "02000000"                                          // triangles
      "000000000000"                                      // three new vertices
      "030001000000"                                      // three back, one back, one new
      "0200000000000300"                                  // west
      "0200000000000100"                                  // south
      "0200000001000200"                                  // east
      "0200000003000200"                                  // north
      "0108000000"                                        // extension 1
      "0102030407080506";                                 // normals, in the new order
  EXPECT_EQ(Hex(EncodeQuantizedMesh(SmallTile(), kWithNormals)), expected);
}

TEST(QuantizedMesh, DecodesToWhatWasEncoded) {
  for (const auto& [columns, rows] : {std::pair{1, 1}, {2, 3}, {17, 9}, {64, 64}}) {
    const QuantizedTile tile = GridTile({9, 100, 200}, columns, rows, -20, 1500, Rugged());
    const DecodedTile decoded = Decoded(EncodeQuantizedMesh(tile, kPlain));
    EXPECT_EQ(Shape(decoded), Shape(tile));
    EXPECT_EQ(decoded.u.size(), tile.u.size());
    EXPECT_EQ(decoded.min_height, -20);
    EXPECT_EQ(decoded.max_height, 1500);
    ExpectCompleteEdges(decoded);
  }
}

TEST(QuantizedMesh, VertexNumbersOnTheInputDoNotMatter) {
  QuantizedTile tile = GridTile({9, 100, 200}, 7, 5, 0, 900, Rugged());
  const std::string bytes = EncodeQuantizedMesh(tile, kWithNormals);
  std::reverse(tile.u.begin(), tile.u.end());
  std::reverse(tile.v.begin(), tile.v.end());
  std::reverse(tile.h.begin(), tile.h.end());
  std::reverse(tile.normals.begin(), tile.normals.end());
  for (auto& triangle : tile.triangles) {
    for (std::uint32_t& index : triangle) index = static_cast<std::uint32_t>(tile.u.size()) - 1 - index;
  }
  EXPECT_EQ(EncodeQuantizedMesh(tile, kWithNormals), bytes);
}

TEST(QuantizedMesh, HeaderIsTheGeometryOfTheDecodedVertices) {
  const QuantizedTile tile = GridTile({6, 20, 40}, 8, 8, 0, 3000, Rugged());
  const DecodedTile decoded = Decoded(EncodeQuantizedMesh(tile, kPlain));
  const auto vec = [](const std::array<double, 3>& a) { return geo::Vec3{a[0], a[1], a[2]}; };
  const geo::Vec3 center = vec(decoded.sphere_center);
  EXPECT_EQ(vec(decoded.center), center);
  double farthest = 0;
  for (const geo::Vec3& p : DecodePositions(tile)) farthest = std::max(farthest, geo::Length(p - center));
  EXPECT_LE(farthest, decoded.sphere_radius);
  EXPECT_NEAR(farthest, decoded.sphere_radius, 1e-3);
  EXPECT_GT(geo::Length(vec(decoded.horizon_point)), 1);
  EXPECT_LT(geo::Length(vec(decoded.horizon_point)), 1.01);
  EXPECT_GT(geo::Dot(geo::Normalized(vec(decoded.horizon_point)), geo::Normalized(center)), 0.99999);
}

TEST(QuantizedMesh, NormalsFollowTheirVertices) {
  const QuantizedTile tile = GridTile({4, 7, 9}, 12, 12, 0, 100, Rugged());
  const DecodedTile decoded = Decoded(EncodeQuantizedMesh(tile, kWithNormals));
  ASSERT_EQ(decoded.extensions.size(), 1u);
  EXPECT_EQ(decoded.extensions[0].id, 1);
  const std::string& bytes = decoded.extensions[0].bytes;
  ASSERT_EQ(bytes.size(), 2 * decoded.u.size());
  std::map<std::pair<int, int>, std::string> expected;
  for (std::size_t i = 0; i < tile.u.size(); ++i) {
    expected[{tile.u[i], tile.v[i]}] = {static_cast<char>(tile.normals[i][0]), static_cast<char>(tile.normals[i][1])};
  }
  for (std::size_t i = 0; i < decoded.u.size(); ++i) {
    EXPECT_EQ(bytes.substr(2 * i, 2), (expected[{decoded.u[i], decoded.v[i]}]));
  }
}

TEST(QuantizedMesh, ExtensionsAreSentOnlyWhenAskedFor) {
  const QuantizedTile tile = SmallTile();
  const std::string plain = EncodeQuantizedMesh(tile, kPlain), normals = EncodeQuantizedMesh(tile, kWithNormals);
  EXPECT_TRUE(Decoded(plain).extensions.empty());
  EXPECT_EQ(normals.substr(0, plain.size()), plain);
  EXPECT_EQ(normals.size(), plain.size() + 5 + 2 * 4);
}

TEST(QuantizedMesh, ExtensionsAreTheseBytesInOrderOfTheirIds) {
  QuantizedTile tile = SmallTile();
  tile.water_mask = {255};
  tile.metadata = R"({"available":[]})";
  const std::string plain = EncodeQuantizedMesh(tile, kPlain);
  const std::string bytes = EncodeQuantizedMesh(tile, {.normals = true, .water_mask = true, .metadata = true});
  EXPECT_EQ(bytes.substr(0, plain.size()), plain);
  EXPECT_EQ(Hex(bytes.substr(plain.size())),
            "01080000000102030407080506"          // normals
            "0201000000ff"                        // water mask
            "041400000010000000"                  // metadata: 4 + 16 bytes, 16 bytes of JSON
            "7b22617661696c61626c65223a5b5d7d");  // {"available":[]}
  const DecodedTile decoded = Decoded(bytes);
  ASSERT_EQ(decoded.extensions.size(), 3u);
  EXPECT_EQ(decoded.extensions[1].bytes, "\xff");
}

TEST(QuantizedMesh, ExtensionsCanBeRemoved) {
  QuantizedTile tile = SmallTile();
  tile.water_mask = {255};
  tile.metadata = R"({"available":[]})";
  const auto options = [](unsigned bits) {
    return TileExtensions{.normals = (bits & 1) != 0, .water_mask = (bits & 2) != 0, .metadata = (bits & 4) != 0};
  };
  for (unsigned from = 0; from < 8; ++from) {
    const std::string encoded = EncodeQuantizedMesh(tile, options(from));
    for (unsigned to = 0; to < 8; ++to) {
      const std::optional<std::string> kept = KeepExtensions(encoded, options(to));
      ASSERT_EQ(kept.has_value(), (to & ~from) == 0) << from << ' ' << to;
      if (kept) {
        EXPECT_EQ(*kept, EncodeQuantizedMesh(tile, options(to))) << from << ' ' << to;
      }
    }
    for (std::size_t size = 0; size < encoded.size(); ++size) {
      const std::optional<std::string> kept = KeepExtensions(encoded.substr(0, size), options(from));
      ASSERT_FALSE(kept) << from << ' ' << size;
    }
  }
}

TEST(QuantizedMesh, AWholeWaterMaskKeepsItsRows) {
  QuantizedTile tile = SmallTile();
  for (int i = 0; i < 65536; ++i) tile.water_mask.push_back(static_cast<std::uint8_t>(i / 256));
  const DecodedTile decoded = Decoded(EncodeQuantizedMesh(tile, {.normals = false, .water_mask = true}));
  ASSERT_EQ(decoded.extensions.size(), 1u);
  EXPECT_EQ(decoded.extensions[0].id, 2);
  EXPECT_EQ(decoded.extensions[0].bytes, std::string(tile.water_mask.begin(), tile.water_mask.end()));
}

TEST(QuantizedMesh, UnusedVerticesAreNotSent) {
  QuantizedTile tile = SmallTile();
  for (auto* values : {&tile.u, &tile.v, &tile.h}) values->push_back(16000);
  tile.normals.push_back({9, 9});
  EXPECT_EQ(EncodeQuantizedMesh(tile, kWithNormals), EncodeQuantizedMesh(SmallTile(), kWithNormals));
}

TEST(QuantizedMesh, HoldsAsManyVerticesAsItPromises) {
  // 13 * 5041 and 2 * 32767
  for (const auto& [columns, rows] : {std::pair{12, 5040}, {1, 32766}}) {
    const QuantizedTile tile = GridTile({5, 3, 3}, columns, rows, 0, 100, Rugged());
    const DecodedTile decoded = Decoded(EncodeQuantizedMesh(tile, kPlain));
    ASSERT_EQ(decoded.u.size(), columns == 12 ? 65533u : kMaxTileVertices);
    EXPECT_EQ(Shape(decoded), Shape(tile));
    ExpectCompleteEdges(decoded);
  }
}

TEST(QuantizedMesh, EveryTruncationIsSeenByADecoder) {
  const QuantizedTile tile = GridTile({7, 30, 40}, 3, 3, 0, 100, Rugged());
  const std::size_t mesh_end = EncodeQuantizedMesh(tile, kPlain).size();
  const std::string bytes = EncodeQuantizedMesh(tile, kWithNormals);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const bool whole_mesh_without_extension = size == mesh_end;
    EXPECT_EQ(DecodeQuantizedMesh(std::string_view(bytes).substr(0, size)).has_value(), whole_mesh_without_extension)
        << size << " of " << bytes.size() << " bytes";
  }
}

TEST(QuantizedMesh, NoByteFollowsTheLastList) {
  const std::string bytes = EncodeQuantizedMesh(SmallTile(), kPlain);
  EXPECT_EQ(bytes.size(), 88u + 4 + 3 * 2 * 4 + 4 + 2 * 6 + 4 * (4 + 2 * 2));
  for (std::size_t extra = 1; extra < 5; ++extra) {
    EXPECT_FALSE(DecodeQuantizedMesh(bytes + std::string(extra, '\0')).has_value());
  }
}

TEST(QuantizedMeshDeathTest, WhatTheFormatCannotHoldIsAMistake) {
  const auto expect_death = [](const QuantizedTile& tile) {
    EXPECT_DEATH(EncodeQuantizedMesh(tile, kWithNormals), "check failed");
  };
  expect_death(GridTile({5, 3, 3}, 254, 256, 0, 100, Rugged()));  // 65,535 vertices
  QuantizedTile out_of_range = SmallTile();
  out_of_range.u[1] = 32768;
  expect_death(out_of_range);
  QuantizedTile without_a_normal = SmallTile();
  without_a_normal.normals.pop_back();
  expect_death(without_a_normal);
  QuantizedTile without_an_east_edge = SmallTile();
  without_an_east_edge.u[1] = 32766;
  expect_death(without_an_east_edge);
  QuantizedTile half_a_mask = SmallTile();
  half_a_mask.water_mask.resize(32768);
  EXPECT_DEATH(EncodeQuantizedMesh(half_a_mask, {.normals = false, .water_mask = true}), "check failed");
  EXPECT_DEATH(EncodeQuantizedMesh(SmallTile(), {.normals = false, .water_mask = false, .metadata = true}),
               "check failed");
  QuantizedTile one_triangle = SmallTile();
  one_triangle.triangles.pop_back();
  expect_death(one_triangle);
}

}  // namespace
}  // namespace terrace::proto
