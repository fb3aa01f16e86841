#include "proto/documents/tileset.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::json;

constexpr HeightSpan kHeights{-1500, 3055.5};

TilesetDescription Maui() {
  TilesetDescription tileset;
  tileset.attribution = "© <a href=\"https://example.org\">a survey</a>";
  tileset.roots = {{{7, 16, 78}, 8}};
  tileset.heights = [](const geo::TileKey&) { return kHeights; };
  return tileset;
}

TEST(Tileset, OneRootIsTheImplicitRootItself) {
  const Json json = Json::parse(EncodeTileset(Maui()));
  EXPECT_EQ(json.at("asset").at("version"), "1.1");
  EXPECT_FALSE(json.contains("extensionsUsed")) << "implicit tiling and GLB content are core 1.1";
  const Json& root = json.at("root");
  EXPECT_EQ(root.at("refine"), "REPLACE");
  EXPECT_EQ(root.at("content").at("uri"), "3dtiles/7-16-78/{level}/{x}/{y}.glb");
  EXPECT_EQ(root.at("implicitTiling"), Json::parse(R"({"subdivisionScheme":"QUADTREE","availableLevels":8,
      "subtreeLevels":4,"subtrees":{"uri":"3dtiles/7-16-78/{level}/{x}/{y}.4.subtree"}})"));
  for (const char* forbidden : {"children", "metadata", "transform"}) EXPECT_FALSE(root.contains(forbidden));
  EXPECT_FALSE(root.at("content").contains("boundingVolume"));
}

TEST(Tileset, EveryUrlCarriesTheVersionFirst) {
  TilesetDescription tileset = Maui();
  tileset.version = "0a1b2c3d4e5f";
  Json json = Json::parse(EncodeTileset(tileset));
  EXPECT_EQ(json.at("asset").at("tilesetVersion"), "0a1b2c3d4e5f");
  const auto uris = [&json] {
    const Json& root = json.at("root");
    return std::pair(root.at("content").at("uri").get<std::string>(),
                     root.at("implicitTiling").at("subtrees").at("uri").get<std::string>());
  };
  EXPECT_EQ(uris(), std::pair(std::string("3dtiles/7-16-78/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f"),
                              std::string("3dtiles/7-16-78/{level}/{x}/{y}.4.subtree?v=0a1b2c3d4e5f")));
  tileset.content_query = "compression=none";
  tileset.subtree_query = "error=5";
  json = Json::parse(EncodeTileset(tileset));
  EXPECT_EQ(uris(), std::pair(std::string("3dtiles/7-16-78/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f&compression=none"),
                              std::string("3dtiles/7-16-78/{level}/{x}/{y}.4.subtree?v=0a1b2c3d4e5f&error=5")));
}

TEST(Tileset, RegionIsTheRootTileInRadians) {
  const Json json = Json::parse(EncodeTileset(Maui()));
  const Json& region = json.at("root").at("boundingVolume").at("region");
  const double tile = std::numbers::pi / 128;
  EXPECT_NEAR(region[0], -std::numbers::pi + 16 * tile, 1e-12);
  EXPECT_NEAR(region[1], -std::numbers::pi / 2 + 78 * tile, 1e-12);
  EXPECT_NEAR(region[2], -std::numbers::pi + 17 * tile, 1e-12);
  EXPECT_NEAR(region[3], -std::numbers::pi / 2 + 79 * tile, 1e-12);
  EXPECT_EQ(region[4], -1500);
  EXPECT_EQ(region[5], 3055.5);
}

TEST(Tileset, SeveralRootsAreChildrenWithoutContentAbove) {
  TilesetDescription tileset = Maui();
  tileset.roots = {{{3, 7, 4}, 3}, {{3, 8, 4}, 12}};
  const Json json = Json::parse(EncodeTileset(tileset));
  const Json& root = json.at("root");
  EXPECT_FALSE(root.contains("content") || root.contains("implicitTiling"));
  ASSERT_EQ(root.at("children").size(), 2u);
  const Json &west = root.at("children")[0].at("boundingVolume").at("region"),
             &east = root.at("children")[1].at("boundingVolume").at("region");
  EXPECT_EQ(west[2], east[0]) << "the same bits: no seam at longitude 0";
  EXPECT_EQ(root.at("children")[0].at("implicitTiling").at("availableLevels"), 3);
  EXPECT_EQ(root.at("children")[1].at("implicitTiling").at("availableLevels"), 12);
  EXPECT_EQ(root.at("boundingVolume").at("region")[0], west[0]);
  EXPECT_EQ(root.at("boundingVolume").at("region")[2], east[2]);
}

// Clients disagree about regions across the antimeridian.
TEST(Tileset, RootsAcrossTheAntimeridianLieInASphere) {
  TilesetDescription tileset = Maui();
  for (const auto& roots : {std::vector<geo::TileKey>{{7, 0, 110}, {7, 255, 110}},
                            {{7, 254, 110}, {7, 1, 110}, {7, 0, 110}, {7, 255, 110}},
                            {{7, 3, 20}, {7, 250, 21}},
                            {{1, 0, 0}, {1, 3, 0}}}) {
    tileset.roots.clear();
    for (const geo::TileKey& tile : roots) tileset.roots.push_back({tile, 1});
    const Json json = Json::parse(EncodeTileset(tileset));
    const Json& bounds = json.at("root").at("boundingVolume");
    ASSERT_FALSE(bounds.contains("region"));
    const Json& sphere = bounds.at("sphere");
    const geo::Vec3 middle{sphere[0], sphere[1], sphere[2]};
    double farthest = 0;
    for (const geo::TileKey& root : roots) {
      const double tile = 180.0 / static_cast<double>(std::int64_t{1} << root.level);
      for (int i = 0; i <= 8; ++i) {
        for (int j = 0; j <= 8; ++j) {
          for (const double height : {kHeights.min_m, kHeights.max_m}) {
            const geo::Vec3 point = geo::ToEcef(-180 + tile * (static_cast<double>(root.x) + i / 8.0),
                                                -90 + tile * (static_cast<double>(root.y) + j / 8.0), height);
            farthest = std::max(farthest, geo::Length(point - middle));
          }
        }
      }
    }
    EXPECT_LE(farthest, sphere[3]);
    EXPECT_GE(farthest, sphere[3].get<double>() / 3) << "not the whole Earth";
  }
}

// For a region of a hemisphere loaders.gl makes a box that misses most of it.
TEST(Tileset, RootsOfTheGlobeLieInASphere) {
  TilesetDescription tileset = Maui();
  tileset.roots.clear();
  for (std::int64_t y = 0; y < 4; ++y) {
    for (std::int64_t x = 0; x < 8; ++x) tileset.roots.push_back({{2, x, y}, 4});
  }
  const Json json = Json::parse(EncodeTileset(tileset));
  const Json& root = json.at("root");
  const Json& sphere = root.at("boundingVolume").at("sphere");
  const double off = geo::Length(geo::Vec3{sphere[0], sphere[1], sphere[2]});
  EXPECT_GE(off, 6e6) << "on the ground: clients aim at it, and at the Earth's centre CesiumJS finds no longitude";
  EXPECT_GE(sphere[3], 6378137.0 + kHeights.max_m + off);
  EXPECT_LE(sphere[3], 6378137.0 + 10000 + off);
  ASSERT_EQ(root.at("children").size(), 32u);
  // CesiumJS throws beyond pi.
  EXPECT_EQ(root.at("children").front().at("boundingVolume").at("region")[0], -std::numbers::pi);
  EXPECT_EQ(root.at("children").back().at("boundingVolume").at("region")[2], std::numbers::pi);
}

// Clients aim at the centre of the sphere, which for a map of the Arctic is the pole.
TEST(Tileset, RootsAllAroundAPoleLieInASphereAboutIt) {
  for (const std::int64_t y : {0, 3}) {
    TilesetDescription tileset = Maui();
    tileset.roots.clear();
    for (std::int64_t x = 0; x < 8; ++x) tileset.roots.push_back({{2, x, y}, 5});
    const Json json = Json::parse(EncodeTileset(tileset));
    const Json& sphere = json.at("root").at("boundingVolume").at("sphere");
    const geo::Vec3 middle{sphere[0], sphere[1], sphere[2]};
    EXPECT_NEAR(middle.x, 0, 1e-6);
    EXPECT_NEAR(middle.y, 0, 1e-6);
    EXPECT_EQ(middle.z > 0, y == 3);
    const double inner = y == 3 ? 45 : -45, outer = y == 3 ? 90 : -90;
    for (const double latitude : {inner, outer}) {
      for (const double height : {kHeights.min_m, kHeights.max_m}) {
        for (const double longitude : {-180.0, -45.0, 0.0, 100.0}) {
          EXPECT_LE(geo::Length(geo::ToEcef(longitude, latitude, height) - middle), sphere[3].get<double>());
        }
      }
    }
    EXPECT_LE(sphere[3], 9.1e6) << "half of the Earth";
  }
}

// For a region with a corner at a pole loaders.gl makes a box without width.
TEST(Tileset, TilesBesideThePolesAreBoundedBySpheres) {
  TilesetDescription tileset = Maui();
  tileset.content_query = "error=5";
  const geo::TileKey key{2, 4, 3};  // Europe
  tileset.roots = {{key, 9, {{{3, 8, 6}, 8}, {{3, 9, 7}, 2}}}};
  const Json root = Json::parse(EncodeTileset(tileset)).at("root");
  EXPECT_EQ(root.at("content").at("uri"), "3dtiles/2-4-3/0/0/0.glb?error=5");
  EXPECT_EQ(root.at("geometricError"), GeometricError(2));
  EXPECT_FALSE(root.contains("implicitTiling"));
  ASSERT_EQ(root.at("children").size(), 2u);
  const Json& child = root.at("children")[0];
  EXPECT_EQ(child.at("content").at("uri"), "3dtiles/3-8-6/{level}/{x}/{y}.glb?error=5");
  EXPECT_EQ(child.at("geometricError"), GeometricError(3));
  EXPECT_EQ(child.at("implicitTiling").at("availableLevels"), 8);
  EXPECT_EQ(child.at("boundingVolume").at("region")[1], std::numbers::pi / 4);

  const Json& sphere = root.at("boundingVolume").at("sphere");
  const geo::Vec3 middle{sphere[0], sphere[1], sphere[2]};
  double farthest = 0;
  for (int i = 0; i <= 32; ++i) {
    for (int j = 0; j <= 32; ++j) {
      for (const double height : {kHeights.min_m, kHeights.max_m}) {
        farthest = std::max(farthest, geo::Length(geo::ToEcef(45 * i / 32.0, 45 + 45 * j / 32.0, height) - middle));
      }
    }
  }
  EXPECT_NEAR(farthest, sphere[3], 1e-3);
}

TEST(Tileset, EveryNamedTileHasHeightsOfItsOwnThatHoldThoseBelow) {
  TilesetDescription tileset = Maui();
  tileset.heights = [](const geo::TileKey& key) {
    return HeightSpan{-static_cast<double>(key.y), 10.0 * key.level + static_cast<double>(key.x)};
  };
  const TreeRoot middle{{4, 10, 10}, 9, {{{5, 20, 20}, 8}, {{5, 21, 21}, 7}}};
  tileset.roots = {{{3, 5, 5}, 10, {middle, {{4, 11, 10}, 4}}}, {{3, 6, 5}, 2}};
  const Json root = Json::parse(EncodeTileset(tileset)).at("root");
  const auto heights = [](const Json& tile) {
    const Json& region = tile.at("boundingVolume").at("region");
    return HeightSpan{region[4], region[5]};
  };
  EXPECT_EQ(heights(root), (HeightSpan{-21, 71}));
  const Json& first = root.at("children")[0];
  EXPECT_EQ(heights(first), (HeightSpan{-21, 71})) << "35 alone";
  EXPECT_EQ(heights(root.at("children")[1]), (HeightSpan{-5, 36}));
  EXPECT_EQ(heights(first.at("children")[0]), (HeightSpan{-21, 71})) << "50 alone";
  EXPECT_EQ(heights(first.at("children")[1]), (HeightSpan{-10, 51}));
  EXPECT_EQ(heights(first.at("children")[0].at("children")[0]), (HeightSpan{-20, 70}));
  EXPECT_EQ(first.at("content").at("uri"), "3dtiles/3-5-5/0/0/0.glb");
  EXPECT_EQ(first.at("children")[0].at("geometricError"), GeometricError(4));
  EXPECT_EQ(first.at("children")[0].at("children")[0].at("implicitTiling").at("availableLevels"), 8);
  const Json &west = first.at("children")[0].at("boundingVolume").at("region"),
             &east = first.at("children")[1].at("boundingVolume").at("region");
  EXPECT_EQ(west[2], east[0]) << "the same bits";
}

TEST(Tileset, SchemaNamesTheHeightsOfSubtrees) {
  const Json json = Json::parse(EncodeTileset(Maui()));
  EXPECT_EQ(json.at("schema"), Json::parse(R"({"id":"terrace","classes":{"tile":{"properties":{
      "min_height":{"type":"SCALAR","componentType":"FLOAT32","semantic":"TILE_MINIMUM_HEIGHT"},
      "max_height":{"type":"SCALAR","componentType":"FLOAT32","semantic":"TILE_MAXIMUM_HEIGHT"}}}}})"));
}

TEST(Tileset, GeometricErrorsFallFromTheTopAndFitTerrainClients) {
  // 16 pixels of it are 2 pixels of the level error that terrain clients assume.
  EXPECT_DOUBLE_EQ(GeometricError(9), 8 * geo::LevelError(9));
  for (int level = 0; level < geo::kMaxLevel; ++level) EXPECT_EQ(GeometricError(level + 1), GeometricError(level) / 2);
  TilesetDescription tileset = Maui();
  tileset.roots = {{{0, 0, 0}, 4}, {{0, 1, 0}, 4}};
  const Json json = Json::parse(EncodeTileset(tileset));
  const double top = json.at("geometricError"), root = json.at("root").at("geometricError"),
               implicit = json.at("root").at("children")[0].at("geometricError");
  EXPECT_GE(top, root);
  EXPECT_GT(root, implicit);
  EXPECT_EQ(implicit, GeometricError(0));
  // Seen from ten Earth radii, on 1,080 lines of 60 degrees: well above the 16 pixels below which nothing is loaded.
  EXPECT_GT(top * 1080 / (10 * 6378137.0 * 2 * 0.577), 100);
}

TEST(Tileset, QueryGoesToTheContentsAlone) {
  TilesetDescription tileset = Maui();
  tileset.content_query = "error=5&atleast=1&compression=none";
  const Json json = Json::parse(EncodeTileset(tileset));
  const Json& root = json.at("root");
  EXPECT_EQ(root.at("content").at("uri"), "3dtiles/7-16-78/{level}/{x}/{y}.glb?error=5&atleast=1&compression=none");
  EXPECT_EQ(root.at("implicitTiling").at("subtrees").at("uri"), "3dtiles/7-16-78/{level}/{x}/{y}.4.subtree");
}

TEST(Tileset, CreditIsWhereCesiumLooks) {
  const Json json = Json::parse(EncodeTileset(Maui()));
  EXPECT_EQ(json.at("asset").at("extras").at("cesium").at("credits").at(0).at("html"),
            "© <a href=\"https://example.org\">a survey</a>");
  TilesetDescription silent = Maui();
  silent.attribution.clear();
  EXPECT_FALSE(Json::parse(EncodeTileset(silent)).at("asset").contains("extras"));
  silent.attribution = "Universit\xe9";  // Latin-1
  EXPECT_NO_THROW(Json::parse(EncodeTileset(silent)));
}

}  // namespace
}  // namespace terrace::proto
