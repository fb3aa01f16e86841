#include "proto/gltf/glb_tile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "proto/error/tile_error.h"
#include "proto/mesh/skirt.h"
#include "proto/mesh/tile_normals.h"
#include "tests/proto/glb_decoder.h"
#include "tests/proto/ground.h"

namespace terrace::proto {
namespace {

constexpr GlbCompression kAllCompressions[] = {GlbCompression::kDraco, GlbCompression::kNone,
                                               GlbCompression::kQuantized, GlbCompression::kMeshopt};

GridMesh Tile(const geo::TileKey& key, int cells, int stride, int ladder = 0, double relief = 1000,
              PositionWidth width = PositionWidth::kFloat) {
  const GlobalGround ground(key, cells, Scattered(relief));
  const tin::TinMesh mesh = RegularMesh(cells, stride);
  const double error = geo::LadderError(key.level, ladder), depth = SkirtDepth(key.level, error);
  double step = GridStep(ground.lattice, error, width);
  std::vector<GridPoint> points = SnapVertices(ground.view(), mesh, step);
  while (!FitsFloats(points, step, depth)) points = SnapVertices(ground.view(), mesh, step *= 2);
  return MakeGridMesh(ground.view(), mesh, points, VertexNormals(ground.view(), mesh, GridPositions(points, step)),
                      step, depth);
}

GlbTile Encode(const GridMesh& mesh, GlbCompression compression, DracoOptions draco = {}) {
  const Result<GlbTile> tile = EncodeGlb(mesh, {compression, draco, "terrace 1.2.3"});
  EXPECT_TRUE(tile.has_value()) << (tile ? "" : tile.error().message);
  return tile.value_or(GlbTile{});
}

// The mesh on the grid, without encoding.
DecodedGlb Truth(const GridMesh& mesh) {
  DecodedGlb glb;
  for (const auto& p : mesh.positions) {
    const auto at = [&](std::size_t axis) { return static_cast<double>(mesh.origin[axis] + p[axis]) * mesh.step_m; };
    glb.positions.push_back({at(0), at(1), at(2)});
  }
  glb.triangles = mesh.triangles;
  return glb;
}

void ExpectTile(const GridMesh& mesh, const GlbTile& tile, double widest_normal_deg) {
  const std::optional<DecodedGlb> glb = DecodeGlb(tile.bytes);
  ASSERT_TRUE(glb.has_value());
  EXPECT_EQ(Surface(*glb), Surface(Truth(mesh)));
  EXPECT_EQ(glb->positions.size(), tile.vertices);
  EXPECT_EQ(glb->triangles.size(), tile.triangles);
  const nlohmann::json& accessor = glb->json.at("accessors").at(0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto less = [&](const auto& a, const auto& b) { return a[axis] < b[axis]; };
    const auto [low, high] = std::minmax_element(glb->stored.begin(), glb->stored.end(), less);
    EXPECT_EQ(accessor.at("min").at(axis), (*low)[axis]);
    EXPECT_EQ(accessor.at("max").at(axis), (*high)[axis]);
  }
  // Normals must be at their vertices; positions are unique here except for merged ones.
  std::map<Corner, std::vector<geo::Vec3>> normals;
  const DecodedGlb truth = Truth(mesh);
  for (std::size_t k = 0; k < mesh.normals.size(); ++k) {
    const geo::Vec3& p = truth.positions[k];
    normals[{p.x, p.y, p.z}].push_back(mesh.normals[k]);
  }
  const double cosine = std::cos(geo::ToRadians(widest_normal_deg));
  for (std::size_t k = 0; k < glb->normals.size(); ++k) {
    const geo::Vec3& p = glb->positions[k];
    double nearest = -1;
    for (const geo::Vec3& n : normals[{p.x, p.y, p.z}]) {
      nearest = std::max(nearest, geo::Dot(n, geo::Normalized(glb->normals[k])));
    }
    EXPECT_GE(nearest, cosine);
    EXPECT_NEAR(geo::Length(glb->normals[k]), 1, 0.01);
  }
}

TEST(GlbTile, DecodesToTheGridInEveryForm) {
  for (const geo::TileKey key : {geo::TileKey{0, 0, 0}, geo::TileKey{1, 3, 1}, geo::TileKey{5, 0, 31},
                                 geo::TileKey{9, 533, 388}, geo::TileKey{13, 8548, 6199}, geo::TileKey{24, 7, 9}}) {
    for (const int ladder : {-16, 0, 13}) {
      for (const GlbCompression compression : kAllCompressions) {
        const GridMesh mesh = Tile(key, 32, 2, ladder, 1000, WidthOf(compression));
        SCOPED_TRACE(testing::Message() << geo::ToString(key) << " ladder " << ladder << " compression "
                                        << static_cast<int>(compression));
        ExpectTile(mesh, Encode(mesh, compression), 1);
      }
    }
  }
}

TEST(GlbTile, KeepsTheGridAtEverySpeedOfDraco) {
  const GridMesh mesh = Tile({9, 533, 388}, 32, 1);
  std::size_t smallest = std::numeric_limits<std::size_t>::max(), fastest = 0;
  for (int speed = 0; speed <= 10; ++speed) {
    SCOPED_TRACE(speed);
    const GlbTile tile = Encode(mesh, GlbCompression::kDraco, {speed, 12});
    ExpectTile(mesh, tile, 0.1);
    smallest = std::min(smallest, tile.bytes.size());
    fastest = tile.bytes.size();
  }
  EXPECT_LT(smallest, fastest);
}

TEST(GlbTile, IsClosedButForTheFeetOfItsSkirts) {
  for (const geo::TileKey key : {geo::TileKey{9, 533, 388}, geo::TileKey{4, 3, 15}, geo::TileKey{0, 1, 0}}) {
    const GridMesh mesh = Tile(key, 32, 2);
    const std::optional<DecodedGlb> glb = DecodeGlb(Encode(mesh, GlbCompression::kDraco).bytes);
    ASSERT_TRUE(glb.has_value());
    const OpenSides open = OpenSidesOf(*glb);
    EXPECT_EQ(open.doubled, 0);
    // The feet form one ring: each has one outgoing and one incoming side. A pole has one point.
    std::map<Corner, int> degree;
    for (const auto& [from, to] : open.sides) {
      ++degree[from];
      --degree[to];
    }
    for (const auto& [point, balance] : degree) EXPECT_EQ(balance, 0);
    EXPECT_EQ(degree.size(), open.sides.size());
    EXPECT_EQ(open.sides.size() == 64, key.level == 9);
  }
}

TEST(GlbTile, SaysWhatClientsNeed) {
  const GridMesh mesh = Tile({9, 533, 388}, 32, 4);
  const auto json = [&](GlbCompression compression) { return DecodeGlb(Encode(mesh, compression).bytes)->json; };
  for (const GlbCompression compression : kAllCompressions) {
    const nlohmann::json glb = json(compression);
    EXPECT_EQ(glb.at("asset").at("generator"), "terrace 1.2.3");
    EXPECT_EQ(glb.at("scenes").at(0).at("nodes"), nlohmann::json::array({0}));
    EXPECT_FALSE(glb.at("nodes").at(0).contains("translation"));
    const nlohmann::json& material = glb.at("materials").at(0);
    EXPECT_EQ(material.at("pbrMetallicRoughness").at("metallicFactor"), 0);
    EXPECT_FALSE(material.value("doubleSided", false));
    EXPECT_EQ(glb.value("extensionsUsed", nlohmann::json()), glb.value("extensionsRequired", nlohmann::json()));
  }
  EXPECT_FALSE(json(GlbCompression::kNone).contains("extensionsRequired"));
  EXPECT_EQ(json(GlbCompression::kDraco).at("extensionsRequired"), nlohmann::json({"KHR_draco_mesh_compression"}));
  EXPECT_EQ(json(GlbCompression::kMeshopt).at("extensionsRequired"),
            nlohmann::json({"KHR_mesh_quantization", "EXT_meshopt_compression"}));
  // Clients rotate the y-up content to ECEF, so the translation is (x, z, -y).
  const auto matrix = json(GlbCompression::kNone).at("nodes").at(0).at("matrix").get<std::vector<double>>();
  const std::vector<double> turn(matrix.begin(), matrix.begin() + 12);
  EXPECT_EQ(turn, (std::vector<double>{1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0}));
  EXPECT_GT(std::hypot(matrix[12], matrix[13], matrix[14]), 6.3e6);
}

TEST(GlbTile, ScalesSixteenBitPositionsByTheMatrix) {
  const GridMesh mesh = Tile({9, 533, 388}, 32, 4, 0, 1000, PositionWidth::k16Bits);
  for (const GlbCompression compression : {GlbCompression::kQuantized, GlbCompression::kMeshopt}) {
    const nlohmann::json glb = DecodeGlb(Encode(mesh, compression).bytes)->json;
    EXPECT_EQ(glb.at("nodes").at(0).at("matrix").at(0), mesh.step_m);
  }
}

TEST(GlbTile, TakesFloatsWhereSixteenBitsAreTooFew) {
  const GridMesh narrow = Tile({9, 533, 388}, 64, 4, 0, 1000, PositionWidth::k16Bits),
                 wide = Tile({9, 533, 388}, 64, 4, 20, 1000, PositionWidth::k16Bits);
  for (const GlbCompression compression : {GlbCompression::kQuantized, GlbCompression::kMeshopt}) {
    const auto component = [&](const GridMesh& mesh) {
      return DecodeGlb(Encode(mesh, compression).bytes)->json.at("accessors").at(0).at("componentType");
    };
    EXPECT_EQ(component(narrow), 5123);
    EXPECT_EQ(component(wide), 5126);
  }
}

// A cliff of a kilometre on a tile of a metre: the grid gets coarser, and the encoders do not fail.
TEST(GlbTile, SurvivesCliffsBeyondTheGrid) {
  const GridMesh mesh = Tile({24, 7, 9}, 32, 2, geo::kFinestStep, 4000);
  EXPECT_GT(mesh.step_m, GridStep({24, 32}, geo::LadderError(24, geo::kFinestStep), PositionWidth::kFloat));
  for (const GlbCompression compression : kAllCompressions) ExpectTile(mesh, Encode(mesh, compression), 1);
}

// 256 x 256 cells, all of them vertices, and the skirts: more than 65,535.
TEST(GlbTile, WidensIndicesPast65535Vertices) {
  const GridMesh mesh = Tile({9, 533, 388}, 256, 1);
  ASSERT_GT(mesh.positions.size(), 65'535u);
  for (const GlbCompression compression : kAllCompressions) {
    const GlbTile tile = Encode(mesh, compression);
    const std::optional<DecodedGlb> glb = DecodeGlb(tile.bytes);
    ASSERT_TRUE(glb.has_value()) << static_cast<int>(compression);
    EXPECT_EQ(glb->json.at("accessors").at(2).at("componentType"), 5125);
    EXPECT_EQ(Surface(*glb), Surface(Truth(mesh)));
  }
}

TEST(GlbTile, GivesTheSameBytesAgain) {
  for (const GlbCompression compression : kAllCompressions) {
    EXPECT_EQ(Encode(Tile({9, 533, 388}, 32, 2), compression).bytes,
              Encode(Tile({9, 533, 388}, 32, 2), compression).bytes);
  }
}

TEST(GlbTile, EveryTruncationIsNoticed) {
  const GridMesh mesh = Tile({9, 533, 388}, 32, 8);
  for (const GlbCompression compression : kAllCompressions) {
    const std::string bytes = Encode(mesh, compression).bytes;
    ASSERT_TRUE(DecodeGlb(bytes).has_value());
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      EXPECT_FALSE(DecodeGlb(std::string_view(bytes).substr(0, size)).has_value()) << size;
    }
    EXPECT_FALSE(DecodeGlb(bytes + std::string(4, '\0')).has_value());
  }
}

// Two flat triangles over a tile of level ocean cut below it by the sagitta of half the diagonal.
TEST(TileErrorMeter, CountsTheCurvatureOfTheEarthUnderFlatTriangles) {
  const GlobalGround ground({9, 512, 256}, 64, [](std::int64_t, std::int64_t) { return 0.0; });
  const tin::TinMesh mesh = RegularMesh(64, 64);
  const double step = 1.0 / 64;
  const TileError error = TileErrorMeter(ground.view(), 1000)
                              .MeasureFlat(mesh, GridPositions(SnapVertices(ground.view(), mesh, step), step));
  const double side = geo::kSemiMajorAxis * geo::ToRadians(180.0 / 512);
  EXPECT_NEAR(error.max_m, side * side / (4 * geo::kSemiMajorAxis), 0.6);
  EXPECT_TRUE(error.to_insert.empty());
}

TEST(TileErrorMeter, SeesTheGridsRounding) {
  const GlobalGround ground({13, 4300, 5700}, 64, Scattered(50));
  const tin::TinMesh mesh = RegularMesh(64, 1);
  const auto measured = [&](double step) {
    return TileErrorMeter(ground.view(), 1000)
        .MeasureFlat(mesh, GridPositions(SnapVertices(ground.view(), mesh, step), step))
        .max_m;
  };
  // A vertex moves by at most sqrt(3) / 2 of a step, on slopes of up to 50 m over 38 m of latitude and 31 m of
  // longitude.
  constexpr double kMaxRatio = 0.87 * (1 + 2.1);
  EXPECT_LE(measured(1.0 / 64), kMaxRatio / 64);
  EXPECT_GT(measured(4), 0.5);
  EXPECT_LE(measured(4), kMaxRatio * 4);
}

}  // namespace
}  // namespace terrace::proto
