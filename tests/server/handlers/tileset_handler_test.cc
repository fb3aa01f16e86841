#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "engine/geo/error_ladder.h"
#include "proto/mesh/skirt.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "tests/proto/subtree_reader.h"
#include "tests/server/handlers/at_once.h"

namespace terrace::server {
namespace {

using Json = nlohmann::json;

class TilesetHandlerTest : public testing::Test {
 protected:
  // 40 x 24 tiles of level 12, all their ancestors, and both roots. The roots of the trees are two tiles of level 7.
  TilesetHandlerTest() {
    DatasetView& maui = datasets_[0];
    maui.name = "maui";
    maui.attribution = "USGS";
    maui.generation = 0x0a1b2c3d4e5f6789;
    maui.heights = {100, 3000};
    maui.floor_m = -20;
    maui.error_scale.max_source_level = 12;
    maui.available.resize(13);
    for (int level = 1; level <= 12; ++level) {
      const int up = 12 - level;
      maui.available[static_cast<std::size_t>(level)] = {{512 >> up, 1024 >> up, 551 >> up, 1047 >> up}};
    }
    maui.available[0] = {{0, 0, 1, 0}};
    state_.emplace(datasets_);
  }
  Response Get(const std::string& target, const char* accept_encoding = "") {
    Request request;
    request.fields.Set(&RequestFields::accept_encoding, accept_encoding);
    const TestContext sent(target, request);
    const bool is_subtree = sent.context.route.row->label == "subtree";
    return AtOnce(is_subtree ? DescribeSubtree(state_->all, sent.context) : DescribeTileset(state_->all, sent.context),
                  request);
  }
  Json Tileset(const std::string& query = "") { return Json::parse(*Get("/maui/tileset.json" + query).body); }

  std::vector<DatasetView> datasets_{1};
  std::optional<TestHandlerState> state_;
};

TEST_F(TilesetHandlerTest, RootsTheTreesWhereTheDataIs) {
  const Json root = Tileset().at("root");
  ASSERT_EQ(root.at("children").size(), 2u);
  const Json& west = root.at("children")[0];
  EXPECT_EQ(west.at("content").at("uri"), "3dtiles/7-16-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f");
  EXPECT_EQ(Tileset().at("asset").at("tilesetVersion"), "0a1b2c3d4e5f");
  EXPECT_EQ(Get("/maui/tileset.json").cache_control, "no-cache");
  EXPECT_EQ(Get("/maui/tileset.json?error=5").cache_control, "no-cache");
  EXPECT_EQ(west.at("implicitTiling").at("availableLevels"), 6);
  EXPECT_EQ(west.at("implicitTiling").at("subtreeLevels"), 6);
}

// A tile has four children or none, so there are tiles without children beside the data and above its roots.
TEST_F(TilesetHandlerTest, RootsTheTreesWhereTheDataIsAmongTilesThatAreThereToMakeFour) {
  DatasetView& maui = datasets_[0];
  const double tile = 180.0 / 4096;
  maui.bounds = {-180 + 513 * tile + 1e-4, -90 + 1025 * tile, -180 + 551 * tile, -90 + 1047.5 * tile};
  for (std::size_t level = 1; level <= 12; ++level) {
    geo::TileRange& range = maui.available[level].front();
    range = {range.start_x & ~1, range.start_y & ~1, range.end_x | 1, range.end_y | 1};
  }
  const auto roots = [&] {
    state_.emplace(datasets_);
    const Json root = Tileset().at("root");
    std::vector<std::string> uris;
    for (const Json& tree : root.at("children")) uris.push_back(tree.at("content").at("uri"));
    return uris;
  };
  const std::vector<std::string> expected = {"3dtiles/7-16-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f",
                                             "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f"};
  EXPECT_EQ(roots(), expected);

  // The same across the antimeridian.
  for (std::size_t level = 1; level <= 12; ++level) {
    geo::TileRange& range = maui.available[level].front();
    const std::int64_t columns = geo::TileColumns(static_cast<int>(level)), middle = std::int64_t{544} >> (12 - level);
    maui.available[level] = {
        {0, range.start_y, std::max<std::int64_t>(range.end_x - middle, 1), range.end_y},
        {columns - std::max<std::int64_t>(middle - range.start_x, 2), range.start_y, columns - 1, range.end_y}};
  }
  maui.bounds.west = 180 - 31 * tile;
  maui.bounds.east = -180 + 7 * tile;
  EXPECT_EQ(roots(), (std::vector<std::string>{"3dtiles/7-0-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f",
                                               "3dtiles/7-255-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f"}));
}

TEST_F(TilesetHandlerTest, RegionHoldsDataFloorAndSkirtsOfTheErrorAskedFor) {
  const auto region = [&](const char* query) {
    return Tileset(query).at("root").at("children")[0].at("boundingVolume").at("region");
  };
  const auto holds = [](const Json& box, double error_m) {
    EXPECT_LE(box[4], -20 - proto::SkirtDepth(7, error_m)) << error_m;
    EXPECT_GE(box[4], -20 - proto::SkirtDepth(7, error_m) - error_m / 3) << "not for nothing: " << error_m;
    EXPECT_GE(box[5], 3000.0);
    EXPECT_LE(box[5], 3000 + error_m / 3) << error_m;
  };
  holds(region(""), geo::DefaultError(7));
  holds(region("?error=5"), geo::DefaultError(7));  // the templates request at least the default
  holds(region("?error=1000"), geo::LadderError(7, geo::SnapToLadder(7, 1000)));
  holds(region("?fraction=0.05"), geo::LadderError(7, geo::SnapToLadder(7, 0.05 * geo::LevelError(7))));
  // Skirts of the deepest level have at least the depth of its default error, also at a small fraction.
  const Json box = region("?fraction=0.008");
  EXPECT_LE(box[4], -20 - proto::SkirtDepth(12, geo::DefaultError(12)));
  EXPECT_GE(box[4], -20 - proto::SkirtDepth(12, geo::DefaultError(12)) - geo::DefaultError(12));
}

TEST_F(TilesetHandlerTest, WritesParametersIntoTheContentTemplates) {
  const auto content = [&](const char* query) {
    return Tileset(query).at("root").at("children")[1].at("content").at("uri").get<std::string>();
  };
  EXPECT_EQ(content("?error=5.00"), "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f&error=5&atleast=1");
  EXPECT_EQ(content("?fraction=.250&compression=none"),
            "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f&fraction=0.25&compression=none");
  EXPECT_EQ(content("?compression=meshopt"), "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f&compression=meshopt");
  EXPECT_EQ(content("?texture=webp&compression=none&texture=webp"),
            "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f&compression=none&texture=webp");
  EXPECT_EQ(content("?v=1"), "3dtiles/7-17-32/{level}/{x}/{y}.glb?v=0a1b2c3d4e5f");
}

// Skirts, and with them the heights in subtrees, depend on the error.
TEST_F(TilesetHandlerTest, WritesParametersForErrorsIntoTheSubtreeTemplates) {
  const auto subtrees = [&](const char* query) {
    const Json tree = Tileset(query).at("root").at("children")[1];
    return tree.at("implicitTiling").at("subtrees").at("uri").get<std::string>();
  };
  EXPECT_EQ(subtrees(""), "3dtiles/7-17-32/{level}/{x}/{y}.6.subtree?v=0a1b2c3d4e5f");
  EXPECT_EQ(subtrees("?error=5.00"), "3dtiles/7-17-32/{level}/{x}/{y}.6.subtree?v=0a1b2c3d4e5f&error=5&atleast=1");
  EXPECT_EQ(subtrees("?fraction=.250&compression=none"),
            "3dtiles/7-17-32/{level}/{x}/{y}.6.subtree?v=0a1b2c3d4e5f&fraction=0.25");
}

TEST_F(TilesetHandlerTest, EveryRootHasTheHeightsOfItsOwnTile) {
  datasets_[0].range_bound = [](const geo::TileKey& key) {
    return dem::HeightRange{static_cast<double>(-key.x), 1000.0 * static_cast<double>(key.x - 15)};
  };
  state_.emplace(datasets_);
  const Json root = Tileset("?fraction=0.05").at("root");
  const auto region = [](const Json& tile) { return tile.at("boundingVolume").at("region"); };
  const double error_m = geo::LadderError(7, geo::SnapToLadder(7, 0.05 * geo::LevelError(7)));
  const double skirt_m = proto::SkirtDepth(7, error_m);
  for (const int x : {16, 17}) {
    const Json box = region(root.at("children")[static_cast<std::size_t>(x - 16)]);
    EXPECT_LE(box[4], -x - skirt_m);
    EXPECT_GE(box[4], -x - skirt_m - error_m / 3);
    EXPECT_GE(box[5], 1000 * (x - 15));
    EXPECT_LE(box[5], 1000 * (x - 15) + error_m / 3);
  }
  EXPECT_EQ(region(root)[4], region(root.at("children")[1])[4]);
  EXPECT_EQ(region(root)[5], region(root.at("children")[1])[5]);
}

TEST_F(TilesetHandlerTest, SubtreesTellTheHeightsOfEachTileAtTheErrorAskedFor) {
  // Wider than the tiles above them: 10 m for each level.
  datasets_[0].range_bound = [](const geo::TileKey& key) {
    return dem::HeightRange{-10.0 * key.level, static_cast<double>(key.x % 4)};
  };
  state_.emplace(datasets_);
  for (const std::string_view query : {"", "?error=600&atleast=1", "?fraction=0.02"}) {
    const Result<proto::ReadSubtree> read =
        proto::ParseSubtree(*Get(std::string("/maui/3dtiles/7-16-32/0/0/0.6.subtree").append(query)).body, 6);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->min_heights.size(), 1365u);
    geo::RequestedError requested;
    if (query.starts_with("?e")) requested = {.error_m = 600, .fraction = {}, .at_least = true};
    if (query.starts_with("?f")) requested.fraction = 0.02;
    const int step = geo::ErrorStep(requested, 12, {.max_source_level = 12});
    const double error_m = geo::LadderError(12, step);
    const double lowest = -120 - proto::SkirtDepth(12, proto::SkirtError(12, step, true, 0.5));
    EXPECT_LE(read->min_heights[341], lowest) << query;
    EXPECT_GE(read->min_heights[341], lowest - error_m / 3) << query;
    EXPECT_GE(read->max_heights[344], 1) << query << ": column 513, row 1025";
    EXPECT_LE(read->max_heights[344], 1 + error_m / 3) << query;
    EXPECT_LE(read->min_heights[0], read->min_heights[341]);
  }
}

// As from an archive whose file cannot be read for a moment.
TEST_F(TilesetHandlerTest, SubtreesWithoutTheRangeOfATileHaveThatOfTheDatasetAndAreAskedForAgain) {
  const std::string target = "/maui/3dtiles/7-16-32/0/0/0.6.subtree?v=" + datasets_[0].version();
  datasets_[0].heights = {-50, 70};
  bool is_readable = false;
  datasets_[0].range_bound = [&](const geo::TileKey& key) -> Result<dem::HeightRange> {
    if (key.level == 12 && !is_readable) return MakeError(ErrorCode::kUnavailable, "cannot be read now");
    return dem::HeightRange{0, 1};
  };
  state_.emplace(datasets_);
  const Response loose = Get(target);
  EXPECT_EQ(loose.cache_control, "no-cache");
  is_readable = true;
  const Response tight = Get(target);
  EXPECT_NE(tight.cache_control, "no-cache");
  const auto height_of = [](const Response& response) {
    const Result<proto::ReadSubtree> read = proto::ParseSubtree(*response.body, 6);
    return read ? read->max_heights[341] : -1;
  };
  EXPECT_GE(height_of(loose), 70);
  EXPECT_LE(height_of(tight), 10);
}

TEST_F(TilesetHandlerTest, TilesetsWithoutTheRangeOfATileAreWrittenAgain) {
  datasets_[0].heights = {-50, 70};
  bool is_readable = false;
  datasets_[0].range_bound = [&](const geo::TileKey&) -> Result<dem::HeightRange> {
    if (!is_readable) return MakeError(ErrorCode::kUnavailable, "cannot be read now");
    return dem::HeightRange{0, 1};
  };
  state_.emplace(datasets_);
  const auto highest = [&] {
    return Tileset().at("root").at("children")[0].at("boundingVolume").at("region")[5].get<double>();
  };
  EXPECT_GE(highest(), 70);
  is_readable = true;
  EXPECT_LT(highest(), 70);
}

TEST_F(TilesetHandlerTest, SubtreesHoldExactlyTheTilesOfTheDataset) {
  for (const char* const root : {"7-16-32", "7-17-32"}) {
    const Response response = Get(std::string("/maui/3dtiles/") + root + "/0/0/0.6.subtree");
    ASSERT_EQ(response.status, 200);
    EXPECT_EQ(response.cache_control, "max-age=1");
    const Result<proto::ReadSubtree> read = proto::ParseSubtree(*response.body, 6);
    ASSERT_TRUE(read) << read.error().message;
    // Of level 12: 32 columns and 24 rows in the western tree, 8 columns in the eastern one.
    const bool west = std::string_view(root) == "7-16-32";
    EXPECT_EQ(std::count(read->tiles.begin() + 341, read->tiles.end(), true), west ? 32 * 24 : 8 * 24) << root;
    EXPECT_TRUE(read->children_constant && !read->children[0]);
  }
}

TEST_F(TilesetHandlerTest, SubtreesGoOnWhereTheFirstOnesEnd) {
  // From the globe's root: levels 0..5, 6..11 and 12.
  EXPECT_EQ(Get("/maui/3dtiles/0-0-0/0/0/0.6.subtree").status, 200);
  const Response deepest = Get("/maui/3dtiles/0-0-0/12/512/1024.6.subtree");
  ASSERT_EQ(deepest.status, 200);
  const Result<proto::ReadSubtree> read = proto::ParseSubtree(*deepest.body, 6);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(std::count(read->tiles.begin(), read->tiles.end(), true), 1);
}

TEST_F(TilesetHandlerTest, SubtreesOfTheCurrentVersionAreKeptForGood) {
  const auto kept = [&](const char* query) {
    return Get(std::string("/maui/3dtiles/7-16-32/0/0/0.6.subtree") + query).cache_control;
  };
  EXPECT_EQ(kept("?v=0a1b2c3d4e5f"), "public, max-age=31536000, immutable");
  EXPECT_EQ(kept("?error=5&atleast=1&v=0a1b2c3d4e5f&v=1"), "public, max-age=31536000, immutable");
  EXPECT_EQ(kept("?v=0a1b2c3d4e5e"), "no-store");
  EXPECT_EQ(kept("?error=5&atleast=1"), "max-age=1");
}

TEST_F(TilesetHandlerTest, IsNotThereWhereNoSubtreeBegins) {
  for (const char* const target : {"/maui/3dtiles/7-18-32/0/0/0.6.subtree",  // a root without tiles
                                   "/maui/3dtiles/7-16-32/1/0/0.6.subtree",  // within the first subtree
                                   "/maui/3dtiles/7-16-32/6/0/0.6.subtree",  // below the deepest level
                                   "/maui/3dtiles/0-0-0/6/0/0.6.subtree",    // outside the data
                                   "/oahu/3dtiles/7-16-32/0/0/0.6.subtree", "/oahu/tileset.json"}) {
    EXPECT_EQ(Get(target).status, 404) << target;
  }
}

TEST_F(TilesetHandlerTest, TakesTheTilesetsParametersOnSubtreesToo) {
  const Response plain = Get("/maui/3dtiles/7-16-32/0/0/0.6.subtree");
  EXPECT_EQ(*Get("/maui/3dtiles/7-16-32/0/0/0.6.subtree?compression=none&v=1").body, *plain.body);
  const Response requested = Get("/maui/3dtiles/7-16-32/0/0/0.6.subtree?error=500&atleast=1");
  EXPECT_EQ(requested.status, 200);
  // deck.gl repeats the query of the tileset.
  EXPECT_EQ(*Get("/maui/3dtiles/7-16-32/0/0/0.6.subtree?error=500&atleast=1&error=500&compression=none").body,
            *requested.body);
  EXPECT_NE(*requested.body, *plain.body) << "deeper skirts";
  EXPECT_EQ(Get("/maui/3dtiles/7-16-32/0/0/0.6.subtree?colour=red").status, 400);
}

TEST_F(TilesetHandlerTest, RefusesBadParameters) {
  for (const char* const query : {"?error=x", "?fraction=-1", "?foo=1", "?compression=zip", "?error=5&error=6",
                                  "?error=5&fraction=1", "?atleast=1"}) {
    EXPECT_EQ(Get(std::string("/maui/tileset.json") + query).status, 400) << query;
  }
}

TEST_F(TilesetHandlerTest, CompressesOnRequest) {
  for (const char* const target : {"/maui/tileset.json", "/maui/3dtiles/7-16-32/0/0/0.6.subtree"}) {
    const Response plain = Get(target), gzip = Get(target, "gzip");
    EXPECT_EQ(gzip.content_encoding, "gzip") << target;
    EXPECT_NE(gzip.etag, plain.etag) << target;
    EXPECT_LT(gzip.body->size(), plain.body->size()) << target;
  }
}

}  // namespace
}  // namespace terrace::server
