// The texture of GLB tiles, decoded as a client does.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include "engine/geo/error_ladder.h"
#include "proto/gltf/glb_tile.h"
#include "proto/mesh/skirt.h"
#include "proto/mesh/tile_normals.h"
#include "tests/proto/glb_decoder.h"
#include "tests/proto/ground.h"

namespace terrace::proto {
namespace {

constexpr GlbCompression kEachCompression[] = {GlbCompression::kDraco, GlbCompression::kNone,
                                               GlbCompression::kQuantized, GlbCompression::kMeshopt};
constexpr geo::TileKey kKey{9, 533, 388};

GridMesh TexturedTile(const geo::TileKey& key, int cells) {
  const GlobalGround ground(key, cells, Scattered(1000));
  const tin::TinMesh mesh = RegularMesh(cells, 4);
  const double error = geo::LadderError(key.level, 0);
  const double step = GridStep(ground.lattice, error, PositionWidth::k16Bits);
  const std::vector<GridPoint> points = SnapVertices(ground.view(), mesh, step);
  return MakeGridMesh(ground.view(), mesh, points, VertexNormals(ground.view(), mesh, GridPositions(points, step)),
                      step, SkirtDepth(key.level, error));
}

GlbOptions Textured(GlbCompression compression, std::string_view media_type = "image/jpeg") {
  GlbOptions options;
  options.compression = compression;
  options.texture = GlbTexture{"not a picture, but bytes", media_type};
  options.copyright = "© a survey";
  return options;
}

DecodedGlb DecodedTexture(const GridMesh& mesh, const GlbOptions& options) {
  const Result<GlbTile> tile = EncodeGlb(mesh, options);
  EXPECT_TRUE(tile.has_value()) << (tile ? "" : tile.error().message);
  const std::optional<DecodedGlb> glb = tile ? DecodeGlb(tile->bytes) : std::nullopt;
  EXPECT_TRUE(glb.has_value());
  return glb.value_or(DecodedGlb{});
}

// Degrees by Bowring's iteration, independent of the encoder, which computes the inverse.
std::array<double, 2> Degrees(const geo::Vec3& p) {
  const double a = geo::kSemiMajorAxis, b = geo::kSemiMinorAxis, e2 = 1 - b * b / (a * a);
  const double r = std::hypot(p.x, p.y);
  double latitude = std::atan2(p.z, r * (1 - e2));
  for (int i = 0; i < 5; ++i) {
    const double n = a / std::sqrt(1 - e2 * std::sin(latitude) * std::sin(latitude));
    latitude = std::atan2(p.z + e2 * n * std::sin(latitude), r);
  }
  constexpr double kDegrees = 57.29577951308232;
  return {std::atan2(p.y, p.x) * kDegrees, latitude * kDegrees};
}

// The edges of the texture are those of the tile, with north at the top. Skirts are below their rim.
TEST(GlbTexture, EveryVertexIsWhereThePictureShowsIt) {
  for (const int cells : {32, 256}) {
    const GridMesh mesh = TexturedTile(kKey, cells);
    const double width = 180.0 / 512, west = static_cast<double>(kKey.x) * width - 180,
                 north = static_cast<double>(kKey.y + 1) * width - 90;
    for (const GlbCompression compression : kEachCompression) {
      const DecodedGlb glb = DecodedTexture(mesh, Textured(compression));
      ASSERT_EQ(glb.uv.size(), glb.positions.size());
      for (std::size_t k = 0; k < glb.uv.size(); ++k) {
        const auto [longitude, latitude] = Degrees(glb.positions[k]);
        ASSERT_NEAR(glb.uv[k][0], (longitude - west) / width, 3e-4) << static_cast<int>(compression);
        ASSERT_NEAR(glb.uv[k][1], (north - latitude) / width, 3e-4) << static_cast<int>(compression);
      }
    }
  }
}

TEST(GlbTexture, IsDescribedAsClientsReadIt) {
  const GridMesh mesh = TexturedTile(kKey, 32);
  for (const GlbCompression compression : kEachCompression) {
    const DecodedGlb glb = DecodedTexture(mesh, Textured(compression));
    EXPECT_EQ(glb.image, "not a picture, but bytes");
    EXPECT_EQ(glb.json.at("asset").at("copyright"), "© a survey");
    EXPECT_EQ(glb.json.at("images").at(0).at("mimeType"), "image/jpeg");
    EXPECT_EQ(glb.json.at("textures"), nlohmann::json::parse(R"([{"sampler": 0, "source": 0}])"));
    EXPECT_EQ(glb.json.at("samplers").at(0).at("wrapS"), 33071);
    EXPECT_EQ(glb.json.at("samplers").at(0).at("wrapT"), 33071);
    const nlohmann::json& pbr = glb.json.at("materials").at(0).at("pbrMetallicRoughness");
    EXPECT_EQ(pbr.at("baseColorTexture").at("index"), 0);
    EXPECT_FALSE(pbr.contains("baseColorFactor")) << "the picture's own colours";
  }
}

TEST(GlbTexture, WebpIsAnExtensionThatReadersMustKnow) {
  for (const GlbCompression compression : kEachCompression) {
    const DecodedGlb glb = DecodedTexture(TexturedTile(kKey, 32), Textured(compression, "image/webp"));
    EXPECT_EQ(glb.json.at("textures").at(0).at("extensions").at("EXT_texture_webp").at("source"), 0);
    EXPECT_FALSE(glb.json.at("textures").at(0).contains("source"));
    const auto required = glb.json.at("extensionsRequired").get<std::vector<std::string>>();
    EXPECT_EQ(std::count(required.begin(), required.end(), "EXT_texture_webp"), 1);
  }
}

TEST(GlbTexture, TilesWithoutOneAreAsBefore) {
  const GridMesh mesh = TexturedTile(kKey, 32);
  for (const GlbCompression compression : kEachCompression) {
    GlbOptions options = Textured(compression);
    options.texture.reset();
    const DecodedGlb plain = DecodedTexture(mesh, options), textured = DecodedTexture(mesh, Textured(compression));
    EXPECT_TRUE(plain.uv.empty() && plain.image.empty());
    EXPECT_FALSE(plain.json.contains("textures"));
    EXPECT_EQ(Surface(plain), Surface(textured)) << "a texture moves no vertex";
  }
}

// The row of a pole is one point, so triangles are left out and vertices merged.
TEST(GlbTexture, SurvivesThePoles) {
  for (const geo::TileKey key : {geo::TileKey{0, 0, 0}, geo::TileKey{4, 3, 15}}) {
    for (const GlbCompression compression : kEachCompression) {
      const DecodedGlb glb = DecodedTexture(TexturedTile(key, 32), Textured(compression));
      ASSERT_EQ(glb.uv.size(), glb.positions.size());
      for (const auto& [u, v] : glb.uv) ASSERT_TRUE(u >= 0 && u <= 1 && v >= 0 && v <= 1);
    }
  }
}

TEST(GlbTexture, ACopyrightThatIsNotUtf8DoesNotStopIt) {
  GlbOptions options = Textured(GlbCompression::kNone);
  options.copyright = "Universit\xe9";  // Latin-1
  EXPECT_EQ(DecodedTexture(TexturedTile(kKey, 32), options).json.at("asset").at("copyright"), "Universit\xef\xbf\xbd");
}

}  // namespace
}  // namespace terrace::proto
