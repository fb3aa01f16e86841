#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "fly/tree/subtree.h"
#include "fly/tree/tile_tree.h"
#include "proto/documents/subtree.h"

namespace terrace::fly {
namespace {

constexpr const char* kTileset = R"({"asset":{"version":"1.1","tilesetVersion":"aaaa"},"geometricError":1e7,"root":{
  "boundingVolume":{"sphere":[0,0,0,7e6]},"geometricError":1e7,"refine":"REPLACE","children":[
  {"boundingVolume":{"region":[0,0,0.7853981633974483,0.7853981633974483,-10,900]},"geometricError":1000,
   "content":{"uri":"t/{level}/{x}/{y}.glb?v=aaaa"},
   "implicitTiling":{"subdivisionScheme":"QUADTREE","availableLevels":3,"subtreeLevels":2,"subtrees":{"uri":"t/{level}.{x}.{y}.subtree?v=aaaa"}}}]}})";

TEST(LayerTree, MakesAllFourChildrenWhereTheServerHasOne) {
  const auto tree = MakeLayerTree(R"({"version":"ab12","tiles":["{z}/{x}/{y}.terrain?v={version}&error=5"],"available":[
    [{"startX":0,"startY":0,"endX":1,"endY":0}],[{"startX":2,"startY":1,"endX":2,"endY":1}]]})");
  ASSERT_TRUE(tree) << tree.error().message;
  Tile& west = *(*tree)->root().children[0];
  Tile& east = *(*tree)->root().children[1];
  (*tree)->AddChildren(west);
  (*tree)->AddChildren(east);
  EXPECT_TRUE(west.children.empty());
  ASSERT_EQ(east.children.size(), 4U);
  EXPECT_EQ(east.children[2]->key, (geo::TileKey{1, 2, 1}));
  EXPECT_EQ(east.children[2]->content, Content::kMesh);
  EXPECT_EQ(east.children[0]->content, Content::kUpsampled);
  EXPECT_EQ((*tree)->RequestFor(*east.children[2]).uri, "1/2/1.terrain?v=ab12&error=5");
  EXPECT_TRUE((*tree)->RequestFor(*east.children[2]).inherits_query);
  EXPECT_EQ((*tree)->RequestFor(*east.children[0]).kind, NextRequest::Kind::kNothing);
  // A 2-pixel error of CesiumJS at level 0 is 77,067 m; 8 times that at 16 pixels.
  EXPECT_NEAR(east.geometric_error_m, 8 * 77067.34, 0.1);
  EXPECT_NEAR(east.children[0]->geometric_error_m, 4 * 77067.34, 0.1);
}

TEST(LayerTree, FindsTilesInManyRanges) {
  std::string ranges;
  for (int i = 0; i < 64; ++i) {  // every other tile of the first row, then a block that reaches far down
    ranges +=
        R"({"startX":)" + std::to_string(2 * i) + R"(,"startY":0,"endX":)" + std::to_string(2 * i) + R"(,"endY":0},)";
  }
  ranges += R"({"startX":3,"startY":1,"endX":9,"endY":40})";
  const auto tree = MakeLayerTree(
      R"({"tiles":["{z}/{x}/{y}"],"available":[[{"startX":0,"startY":0,"endX":1,"endY":0}],[)" + ranges + "]]}");
  ASSERT_TRUE(tree);
  Tile parent;
  parent.volume = Region({0, 0, 1, 1}, 0, 1);
  parent.key = geo::TileKey{0, 2, 15};
  parent.children_unknown = true;
  (*tree)->AddChildren(parent);
  ASSERT_EQ(parent.children.size(), 4U);
  for (const auto& child : parent.children) EXPECT_EQ(child->content, Content::kMesh);
}

TEST(LayerTree, RequestsNoRootThatIsNotAvailable) {
  const auto tree = MakeLayerTree(R"({"tiles":["{z}/{x}/{y}"],"available":[
    [{"startX":0,"startY":0,"endX":0,"endY":0}],[{"startX":2,"startY":1,"endX":2,"endY":1}]]})");
  ASSERT_TRUE(tree);
  Tile& west = *(*tree)->root().children[0];
  Tile& east = *(*tree)->root().children[1];
  EXPECT_EQ((*tree)->RequestFor(west).kind, NextRequest::Kind::kMesh);
  EXPECT_TRUE(west.NeedsLoad());
  EXPECT_EQ((*tree)->RequestFor(east).kind, NextRequest::Kind::kNothing);
  EXPECT_FALSE(east.NeedsLoad());
  (*tree)->AddChildren(east);
  EXPECT_EQ(east.children.size(), 4U);
}

TEST(LayerTree, KnowsWhetherThereAreFinerLevels) {
  const auto document = [](const std::string& finer) {
    return R"({"tiles":["x"],"available":[[{"startX":0,"startY":0,"endX":1,"endY":0}])" + finer + "]}";
  };
  const std::string finer = document(R"(,[],[{"startX":8,"startY":1,"endX":8,"endY":1}])");
  for (const char* without : {"", ",[]"}) {
    const auto tree = MakeLayerTree(document(without));
    ASSERT_TRUE(tree);
    EXPECT_FALSE((*tree)->has_finer_levels()) << without;
    ASSERT_TRUE((*tree)->TakeDocument(finer));
    EXPECT_TRUE((*tree)->has_finer_levels());
  }
  EXPECT_TRUE((*MakeLayerTree(finer))->has_finer_levels());
}

TEST(LayerTree, NotesThatItDoesNotReadTheMetadataOfTiles) {
  const auto note = [](const std::string& members) {
    const auto tree =
        MakeLayerTree(R"({"tiles":["x"],"available":[[{"startX":0,"startY":0,"endX":1,"endY":0}]])" + members + "}");
    return tree ? (*tree)->note() : tree.error().message;
  };
  EXPECT_NE(note(R"(,"metadataAvailability":10)").find("uses \"available\" alone"), std::string::npos);
  for (const char* without : {"", R"(,"metadataAvailability":0)", R"(,"scheme":"tms","parentUrl":"")"}) {
    EXPECT_EQ(note(without), "") << without;
  }
}

TEST(LayerTree, SaysWhatItCannotRead) {
  const auto message = [](std::string_view text) { return MakeLayerTree(text).error().message; };
  EXPECT_NE(message("<html>").find("layer.json cannot be read"), std::string::npos);
  for (const char* none : {R"({"tiles":["x"]})", R"({"tiles":["x"],"available":[]})",
                           R"({"tiles":["x"],"available":[[],[]],"metadataAvailability":10})",
                           R"({"tilejson":"2.1.0","format":"quantized-mesh-1.0","tiles":["x"]})"}) {
    EXPECT_TRUE(message(none).starts_with("layer.json lists no tiles in \"available\"; fly needs them")) << none;
  }
  EXPECT_EQ(message(R"({"scheme":"slippyMap","tiles":["x"]})"),
            "layer.json: \"scheme\" is \"slippyMap\"; only \"tms\" can be flown over");
  EXPECT_NE(message(R"({"parentUrl":"./world","tiles":["x"]})").find("has a \"parentUrl\""), std::string::npos);
  EXPECT_NE(message(R"({"projection":"EPSG:3857","tiles":["x"],"available":[]})").find("EPSG:3857"), std::string::npos);
  EXPECT_EQ(message(R"({"tilejson":"3.0.0","format":"png","tiles":["x"]})"),
            "this is the TileJSON of a map; give the URL of a layer.json or tileset.json");
  for (const std::string_view other : {std::string_view(kTileset), std::string_view("[1]"), std::string_view("{}")}) {
    EXPECT_EQ(message(other),
              "this is no layer.json: it has no \"tiles\"; give the URL of a layer.json, or fly over a tileset with "
              "--format 3dtiles");
  }
  EXPECT_EQ(message(R"({"tiles":["x"],"available":[[{"startX":0}]]})"),
            "layer.json cannot be read: key 'startY' not found");
}

std::string SubtreeBytes(int levels, std::vector<std::vector<geo::TileRange>> tiles) {
  proto::Subtree subtree;
  subtree.levels = levels;
  subtree.tiles = std::move(tiles);
  return proto::EncodeSubtree(subtree);
}

// A binary subtree without bits.
std::string SubtreeOfJson(const std::string& json) {
  std::string bytes("subt\x01\0\0\0", 8);
  const auto put = [&bytes](std::uint64_t value) { bytes.append(reinterpret_cast<const char*>(&value), 8); };
  put(json.size());
  put(0);
  return bytes + json;
}

// Replaces the first `before` of kTileset.
std::string TilesetWith(const std::string& before, const std::string& after) {
  std::string tileset = kTileset;
  return tileset.replace(tileset.find(before), before.size(), after);
}

Tile& ImplicitRootOf(TileTree& tree) { return *tree.root().children[0]->children[0]->children[0]; }

TEST(TilesetTree, GrowsWithItsSubtrees) {
  auto made = MakeTilesetTree(kTileset);
  ASSERT_TRUE(made) << made.error().message;
  TileTree& tree = **made;
  Tile& top = *tree.root().children[0];
  EXPECT_EQ(top.content, Content::kEmpty);
  Tile& place = *top.children[0];
  EXPECT_TRUE(place.always_refine);
  Tile& root = *place.children[0];
  EXPECT_EQ(root.key, (geo::TileKey{2, 4, 2}));
  NextRequest request = tree.RequestFor(root);
  EXPECT_EQ(request.kind, NextRequest::Kind::kSubtree);
  EXPECT_EQ(request.uri, "t/0.0.0.subtree?v=aaaa");
  tree.AddChildren(root);
  EXPECT_TRUE(root.children.empty());

  ASSERT_TRUE(tree.TakeSubtree(root, SubtreeBytes(2, {{{0, 0, 0, 0}}, {{1, 0, 1, 1}}, {{3, 2, 3, 2}}})));
  request = tree.RequestFor(root);
  EXPECT_EQ(request.kind, NextRequest::Kind::kMesh);
  EXPECT_EQ(request.uri, "t/0/0/0.glb?v=aaaa");
  EXPECT_FALSE(request.inherits_query) << "templates of implicit tilings do not";
  tree.AddChildren(root);
  ASSERT_EQ(root.children.size(), 2U);  // (1, 0) and (1, 1)
  Tile& north_east = *root.children[1];
  EXPECT_EQ(north_east.key, (geo::TileKey{3, 9, 5}));
  EXPECT_DOUBLE_EQ(north_east.geometric_error_m, 500);
  tree.AddChildren(north_east);
  ASSERT_EQ(north_east.children.size(), 1U);  // the root of the next subtree
  EXPECT_EQ(tree.RequestFor(*north_east.children[0]).uri, "t/2.3.2.subtree?v=aaaa");
}

TEST(TilesetTree, KnowsWhetherThereAreFinerLevels) {
  const auto has_finer_levels = [](const std::string& members) {
    const std::string region = R"("region":[0,-1.5707963267948966,3.141592653589793,1.5707963267948966,0,1])";
    const auto tree = MakeTilesetTree(R"({"asset":{},"root":{"boundingVolume":{)" + region +
                                      R"(},"geometricError":9,"content":{"uri":"a.glb"})" + members + "}}");
    EXPECT_TRUE(tree) << tree.error().message;
    return tree && (*tree)->has_finer_levels();
  };
  const std::string implicit = R"(,"implicitTiling":{"subdivisionScheme":"QUADTREE","subtreeLevels":2,)"
                               R"("subtrees":{"uri":"a.subtree"},"availableLevels":)";
  EXPECT_FALSE(has_finer_levels(""));
  EXPECT_FALSE(has_finer_levels(implicit + "1}"));
  EXPECT_TRUE(has_finer_levels(implicit + "2}"));
  EXPECT_TRUE(has_finer_levels(R"(,"children":[{"geometricError":1,"boundingVolume":{"region":[0,0,)"
                               R"(1.5707963267948966,1.5707963267948966,0,1]}}])"));
}

TEST(TilesetTree, DoesNotRequestTheContentOfASubtreesRootThatHasNone) {
  auto made = MakeTilesetTree(kTileset);
  ASSERT_TRUE(made);
  Tile& root = *(*made)->root().children[0]->children[0]->children[0];
  ASSERT_TRUE((*made)->TakeSubtree(root, SubtreeOfJson(R"({"tileAvailability":{"constant":1},)"
                                                       R"("contentAvailability":[{"constant":0}],)"
                                                       R"("childSubtreeAvailability":{"constant":0}})")));
  EXPECT_EQ((*made)->RequestFor(root).kind, NextRequest::Kind::kNothing);
  EXPECT_EQ(root.content, Content::kEmpty);
  (*made)->AddChildren(root);
  EXPECT_EQ(root.children.size(), 4U);
}

// The tiles 6/127/32 and 6/0/32 are side by side there.
TEST(TilesetTree, DividesARegionAcrossTheAntimeridian) {
  const double pi = 3.14159265358979323846, side = pi / 64;
  std::string tileset = kTileset;
  const std::string region = "0,0,0.7853981633974483,0.7853981633974483";
  tileset.replace(tileset.find(region), region.size(),
                  fmt::format("{:.17f},0,{:.17f},{:.17f}", pi - side, -pi + side, 2 * side));
  auto made = MakeTilesetTree(tileset);
  ASSERT_TRUE(made) << made.error().message;
  Tile& root = *(*made)->root().children[0]->children[0]->children[0];
  ASSERT_TRUE((*made)->TakeSubtree(root, SubtreeBytes(2, {{{0, 0, 0, 0}}, {{0, 0, 1, 1}}, {}})));
  (*made)->AddChildren(root);
  ASSERT_EQ(root.children.size(), 4U);
  EXPECT_FALSE(root.key);
  EXPECT_EQ(root.children[0]->key, (geo::TileKey{6, 127, 32}));
  EXPECT_EQ(root.children[1]->key, (geo::TileKey{6, 0, 32}));
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(MeetsVertical(root.children[i]->volume, {179, 1, 0}), i == 0) << i;
    EXPECT_EQ(MeetsVertical(root.children[i]->volume, {-179, 1, 0}), i == 1) << i;
  }
}

// Every tile and every subtree is available, as a constant says, but only three levels are.
TEST(TilesetTree, EndsAtItsLastLevel) {
  const std::string all = SubtreeOfJson(R"({"tileAvailability":{"constant":1},"contentAvailability":[{"constant":1}],)"
                                        R"("childSubtreeAvailability":{"constant":1}})");
  for (const auto& [levels, deepest] : {std::pair("3", 2), std::pair("1", 0), std::pair("31", 30)}) {
    auto made = MakeTilesetTree(TilesetWith(R"("availableLevels":3)", std::string(R"("availableLevels":)") + levels));
    ASSERT_TRUE(made) << made.error().message;
    Tile* tile = &ImplicitRootOf(**made);
    for (int steps = 0; steps < 40; ++steps) {
      if ((*made)->RequestFor(*tile).kind == NextRequest::Kind::kSubtree) {
        ASSERT_TRUE((*made)->TakeSubtree(*tile, all));
      }
      EXPECT_EQ((*made)->RequestFor(*tile).kind, NextRequest::Kind::kMesh);
      (*made)->AddChildren(*tile);
      if (tile->children.empty()) break;
      tile = tile->children.back().get();
    }
    EXPECT_EQ(tile->local, (geo::TileKey{deepest, (std::int64_t{1} << deepest) - 1, (std::int64_t{1} << deepest) - 1}));
    EXPECT_FALSE(tile->children_unknown);
  }
  for (const char* levels : {"0", "32"}) {
    EXPECT_FALSE(MakeTilesetTree(TilesetWith(R"("availableLevels":3)", std::string(R"("availableLevels":)") + levels)));
  }
}

TEST(TilesetTree, MayHaveNoContent) {
  const std::string tiles = R"({"tileAvailability":{"constant":1},"childSubtreeAvailability":{"constant":1})";
  const std::string content = R"("content":{"uri":"t/{level}/{x}/{y}.glb?v=aaaa"},)";
  // Neither in the subtree nor in the tileset.
  for (const auto& [tileset, subtree] :
       {std::pair(std::string(kTileset), tiles + "}"),
        std::pair(TilesetWith(content, ""), tiles + R"(,"contentAvailability":[{"constant":1}]})")}) {
    auto made = MakeTilesetTree(tileset);
    ASSERT_TRUE(made) << made.error().message;
    Tile& root = ImplicitRootOf(**made);
    EXPECT_EQ((*made)->RequestFor(root).kind, NextRequest::Kind::kSubtree);
    const Result<void> taken = (*made)->TakeSubtree(root, SubtreeOfJson(subtree));
    ASSERT_TRUE(taken) << taken.error().message;
    (*made)->AddChildren(root);
    ASSERT_EQ(root.children.size(), 4U);
    for (const Tile* tile : {&root, root.children[3].get()}) {
      EXPECT_EQ((*made)->RequestFor(*tile).kind, NextRequest::Kind::kNothing);
    }
    (*made)->AddChildren(*root.children[3]);
    ASSERT_EQ(root.children[3]->children.size(), 4U);
    EXPECT_EQ((*made)->RequestFor(*root.children[3]->children[0]).kind, NextRequest::Kind::kSubtree);
  }
}

TEST(TilesetTree, ReadsTheFormsOf3dTiles1_0) {
  auto made = MakeTilesetTree(R"({"asset":{"version":"1.0"},"root":{"boundingVolume":{"sphere":[0,0,0,7e6]},
    "geometricError":1e5,"refine":"replace","content":{"url":"a.glb"}}})");
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ((*made)->RequestFor(*(*made)->root().children[0]).uri, "a.glb");
}

TEST(TilesetTree, NamesWhatItDoesNotRead) {
  const std::string region = R"("region":[0,0,0.7853981633974483,0.7853981633974483,-10,900])";
  for (const auto& [name, tileset] :
       {std::pair("3DTILES_implicit_tiling",
                  TilesetWith(R"("implicitTiling":{)", R"("extensions":{"3DTILES_implicit_tiling":{}},"unused":{)")),
        std::pair("3DTILES_bounding_volume_S2",
                  TilesetWith(region, R"("extensions":{"3DTILES_bounding_volume_S2":{"token":"1"}})")),
        std::pair("\"contents\"",
                  TilesetWith(R"("content":{"uri":"t/{level}/{x}/{y}.glb?v=aaaa"})", R"("contents":[])")),
        std::pair("an external tileset, t/a.json", TilesetWith("t/{level}/{x}/{y}.glb?v=aaaa", "t/a.json?token=t"))}) {
    const auto made = MakeTilesetTree(tileset);
    ASSERT_FALSE(made) << name;
    EXPECT_TRUE(made.error().message.starts_with(std::string("tileset.json cannot be read: it uses ") + name))
        << made.error().message;
    EXPECT_TRUE(made.error().message.ends_with(", which fly does not read"));
  }
}

TEST(TilesetTree, FillsEachVariableOfATemplate) {
  std::string tileset = kTileset;
  tileset.replace(tileset.find("t/{level}/{x}/{y}.glb"), 21, "{x}/{level}/{x}/{y}.glb");
  auto made = MakeTilesetTree(tileset);
  ASSERT_TRUE(made);
  Tile& root = *(*made)->root().children[0]->children[0]->children[0];
  ASSERT_TRUE((*made)->TakeSubtree(root, SubtreeBytes(2, {{{0, 0, 0, 0}}, {}, {}})));
  EXPECT_EQ((*made)->RequestFor(root).uri, "0/0/0/0.glb?v=aaaa");
}

TEST(TilesetTree, FollowsTheVersionOfItsDocument) {
  auto made = MakeTilesetTree(kTileset);
  ASSERT_TRUE(made);
  std::string later = kTileset;
  for (std::size_t at; (at = later.find("aaaa")) != std::string::npos;) later.replace(at, 4, "bbbb");
  ASSERT_TRUE((*made)->TakeDocument(later));
  EXPECT_EQ((*made)->version(), "bbbb");
  EXPECT_EQ((*made)->RequestFor(*(*made)->root().children[0]->children[0]->children[0]).uri, "t/0.0.0.subtree?v=bbbb");
}

TEST(TilesetTree, ReplacesTheVersionInTheQueryAlone) {
  const std::string tileset = kTileset;
  const auto with = [&tileset](const std::string& version, const std::string& uri) {
    std::string text = tileset;
    text.replace(text.find("t/{level}.{x}.{y}.subtree?v=aaaa"), 32, uri);
    return text.replace(text.find("aaaa"), 4, version);
  };
  for (const auto& [before, after] : {std::pair("v2/2.subtree?v=2", "v2/2.subtree?v=5"),
                                      std::pair("2.subtree?error=12&v=2&w=20", "2.subtree?error=12&v=5&w=20"),
                                      std::pair("2/2.subtree", "2/2.subtree")}) {
    auto made = MakeTilesetTree(with("2", before));
    ASSERT_TRUE(made) << made.error().message;
    ASSERT_TRUE((*made)->TakeDocument(with("5", before)));
    EXPECT_EQ((*made)->RequestFor(*(*made)->root().children[0]->children[0]->children[0]).uri, after);
  }
}

TEST(TilesetTree, SaysWhatItCannotRead) {
  for (const char* other : {"{}", "[1]", R"({"tiles":["x"],"available":[]})"}) {
    EXPECT_EQ(MakeTilesetTree(other).error().message,
              "this is no tileset.json: it has no \"asset\"; give the URL of a tileset.json, or fly over a layer.json "
              "without --format 3dtiles");
  }
  EXPECT_NE(MakeTilesetTree(R"({"asset":{}})").error().message.find("it has no \"root\"; give"), std::string::npos);
  EXPECT_EQ(MakeTilesetTree(R"({"asset":{},"root":{}})").error().message,
            "tileset.json cannot be read: key 'boundingVolume' not found");
  std::string added = kTileset;
  added.replace(added.find("REPLACE"), 7, "ADD");
  EXPECT_NE(MakeTilesetTree(added).error().message.find("does not REPLACE"), std::string::npos);
}

TEST(Subtree3d, ReadsTheEncodersBits) {
  const std::string bytes = SubtreeBytes(3, {{{0, 0, 0, 0}}, {{0, 0, 1, 1}}, {{0, 0, 1, 3}, {3, 3, 3, 3}}, {}});
  const Result<Subtree3d> subtree = Subtree3d::Parse(bytes, 3);
  ASSERT_TRUE(subtree) << subtree.error().message;
  for (std::uint32_t y = 0; y < 4; ++y) {
    for (std::uint32_t x = 0; x < 4; ++x) {
      EXPECT_EQ(subtree->HasTile(2, x, y), x < 2 || (x == 3 && y == 3)) << x << " " << y;
      EXPECT_EQ(subtree->HasContent(2, x, y), subtree->HasTile(2, x, y));
    }
  }
  EXPECT_FALSE(subtree->HasSubtree(0, 0));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(Subtree3d::Parse(std::string_view(bytes).substr(0, size), 3));
  EXPECT_FALSE(Subtree3d::Parse(bytes, 5));
}

TEST(Subtree3d, NamesTheFormsThatItDoesNotRead) {
  const std::string json = R"({"buffers":[{"uri":"a.bin","byteLength":8}],"bufferViews":[{"buffer":0,"byteLength":8}],)"
                           R"("tileAvailability":{"bitstream":0},"childSubtreeAvailability":{"constant":0}})";
  for (const std::string& subtree : {json, SubtreeOfJson(json)}) {
    const Error error = Subtree3d::Parse(subtree, 2).error();
    EXPECT_EQ(error.code, ErrorCode::kNotFound);
    EXPECT_NE(error.message.find("not supported"), std::string::npos) << error.message;
  }
  EXPECT_EQ(Subtree3d::Parse("<html>", 2).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace terrace::fly
