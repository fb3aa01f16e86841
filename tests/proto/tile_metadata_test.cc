#include "proto/mesh/tile_metadata.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace terrace::proto {
namespace {

using Json = nlohmann::json;

// Roots, a block across both, and one in the east.
const std::vector<std::vector<geo::TileRange>> kAvailable = {
    {{0, 0, 1, 0}}, {{1, 0, 2, 1}}, {{3, 1, 4, 2}}, {{6, 3, 8, 4}}};

TEST(CarriesMetadata, EveryNthLevelButTheDeepest) {
  const std::vector<std::vector<geo::TileRange>> available(10, {{0, 0, 0, 0}});
  std::vector<int> levels;
  for (int level = 0; level <= 9; ++level) {
    if (CarriesMetadata({level, 0, 0}, 3, 9, available)) levels.push_back(level);
    EXPECT_FALSE(CarriesMetadata({level, 0, 0}, 0, 9, available));
  }
  EXPECT_EQ(levels, (std::vector<int>{0, 3, 6}));
}

// Levels 2 and 3 are those of edits.
TEST(CarriesMetadata, FromTheFinestLevelOnWhereItHasChildren) {
  EXPECT_TRUE(CarriesMetadata({0, 0, 0}, 1, 1, kAvailable));
  EXPECT_TRUE(CarriesMetadata({1, 1, 0}, 1, 1, kAvailable));
  EXPECT_TRUE(CarriesMetadata({1, 2, 1}, 1, 1, kAvailable));
  EXPECT_FALSE(CarriesMetadata({1, 0, 0}, 1, 1, kAvailable));
  EXPECT_TRUE(CarriesMetadata({1, 0, 0}, 1, 2, kAvailable));
  EXPECT_TRUE(CarriesMetadata({2, 3, 1}, 1, 1, kAvailable));
  EXPECT_FALSE(CarriesMetadata({2, 1, 1}, 1, 1, kAvailable));
  EXPECT_FALSE(CarriesMetadata({3, 6, 3}, 1, 1, kAvailable));
}

TEST(TileMetadata, AreTheseBytes) {
  EXPECT_EQ(EncodeTileMetadata({1, 1, 1}, kAvailable, 1),
            R"({"available":[[{"startX":3,"startY":2,"endX":3,"endY":2}]]})");
}

TEST(TileMetadata, ListsWhatIsBelowTheTileAndNoMore) {
  EXPECT_EQ(Json::parse(EncodeTileMetadata({0, 0, 0}, kAvailable, 2)),
            Json::parse(R"({"available":[[{"startX":1,"startY":0,"endX":1,"endY":1}],
                                         [{"startX":3,"startY":1,"endX":3,"endY":2}]]})"));
  EXPECT_EQ(Json::parse(EncodeTileMetadata({0, 1, 0}, kAvailable, 2)),
            Json::parse(R"({"available":[[{"startX":2,"startY":0,"endX":2,"endY":1}],
                                         [{"startX":4,"startY":1,"endX":4,"endY":2}]]})"));
}

// A further tile in the east divides the rows of the block below the tile.
TEST(TileMetadata, DoesNotDependOnTilesBeside) {
  const std::vector<std::vector<geo::TileRange>> block = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 5, 3}}};
  std::vector<std::vector<geo::TileRange>> more = block;
  more[2] = {{0, 0, 5, 0}, {0, 1, 6, 2}, {0, 3, 5, 3}};
  EXPECT_EQ(EncodeTileMetadata({0, 0, 0}, more, 2), EncodeTileMetadata({0, 0, 0}, block, 2));
  EXPECT_NE(EncodeTileMetadata({0, 1, 0}, more, 2), EncodeTileMetadata({0, 1, 0}, block, 2));
}

TEST(TileMetadata, EndsAtTheDeepestLevel) {
  EXPECT_EQ(Json::parse(EncodeTileMetadata({2, 3, 1}, kAvailable, 5)),
            Json::parse(R"({"available":[[{"startX":6,"startY":3,"endX":7,"endY":3}]]})"));
}

TEST(TileMetadata, KeepsALevelWithoutTiles) {
  EXPECT_EQ(EncodeTileMetadata({1, 0, 0}, kAvailable, 2), R"({"available":[[],[]]})");
}

// The metadata of all tiles of a level together is equal to layer.json.
TEST(TileMetadata, TogetherCoverWhatIsAvailable) {
  std::int64_t tiles = 0;
  for (std::int64_t x = 0; x < 2; ++x) {
    const Json available = Json::parse(EncodeTileMetadata({0, x, 0}, kAvailable, 3)).at("available");
    for (const Json& range : available.at(2)) {
      tiles += (range["endX"].get<std::int64_t>() - range["startX"].get<std::int64_t>() + 1) *
               (range["endY"].get<std::int64_t>() - range["startY"].get<std::int64_t>() + 1);
    }
  }
  EXPECT_EQ(tiles, 6);
}

}  // namespace
}  // namespace terrace::proto
