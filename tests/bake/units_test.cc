#include "bake/units.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "bake/baker.h"
#include "bake/cell_list.h"

namespace terrace::bake {
namespace {

using Key = std::tuple<int, std::int64_t, std::int64_t>;

std::vector<Key> TilesOf(const Unit& unit) {
  std::vector<Key> tiles;
  for (const Part& part : PartsOf(unit)) {
    Walk(unit.tiles, part, [&](const geo::TileKey& key) {
      tiles.emplace_back(key.level, key.x, key.y);
      return true;
    });
  }
  return tiles;
}

// Both roots, and on each level the children of some tiles.
Pyramid SomePyramid(int deepest) {
  Pyramid pyramid = {{{0, 0, 1, 0}}};
  for (int level = 1; level <= deepest; ++level) {
    const std::int64_t x = std::int64_t{3} << (level - 1), y = std::int64_t{1} << (level - 1);
    pyramid.push_back({{x & ~1, std::max<std::int64_t>((y - 2) & ~1, 0),
                        std::min((x + 2) | 1, geo::TileColumns(level) - 1), std::min(y | 1, geo::TileRows(level) - 1)},
                       {0, 0, 1, 1}});
  }
  return pyramid;
}

TEST(Units, HaveEachTileOnce) {
  for (const int deepest : {0, 1, 3, 6, 7, 8, 12}) {
    const Pyramid pyramid = SomePyramid(deepest);
    std::set<Key> expected, found;
    for (int level = 0; level <= deepest; ++level) {
      for (const geo::TileRange& range : pyramid[static_cast<std::size_t>(level)]) {
        for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
          for (std::int64_t x = range.start_x; x <= range.end_x; ++x) expected.emplace(level, x, y);
        }
      }
    }
    std::uint64_t count = 0;
    for (const Unit& unit : UnitsOf(pyramid)) {
      const std::vector<Key> tiles = TilesOf(unit);
      EXPECT_EQ(tiles.size(), CountTiles(unit.tiles)) << unit.name;
      count += tiles.size();
      found.insert(tiles.begin(), tiles.end());
    }
    EXPECT_EQ(count, expected.size()) << deepest;
    EXPECT_EQ(found, expected) << deepest;
  }
}

TEST(Units, ShallowDatasetsAreTheTopAlone) {
  const std::vector<Unit> units = UnitsOf(SomePyramid(6));
  ASSERT_EQ(units.size(), 1U);
  EXPECT_EQ(units[0].name, "top");
  EXPECT_FALSE(units[0].root);
}

TEST(Units, PyramidsMayBeginDeep) {
  Pyramid pyramid(10);
  pyramid[9] = {{512, 256, 521, 259}};  // of height tiles
  std::uint64_t count = 0;
  for (const Unit& unit : UnitsOf(pyramid)) {
    EXPECT_NE(unit.name, "top");
    count += TilesOf(unit).size();
  }
  EXPECT_EQ(count, 40U);
}

TEST(Units, ChildrenFollowTheirParents) {
  for (const Unit& unit : UnitsOf(SomePyramid(11))) {
    for (const Part& part : PartsOf(unit)) {
      std::set<Key> seen;
      Walk(unit.tiles, part, [&](const geo::TileKey& key) {
        if (key.level > part.root.level) {
          EXPECT_TRUE(seen.contains({key.level - 1, key.x / 2, key.y / 2}));
        }
        seen.emplace(key.level, key.x, key.y);
        return true;
      });
    }
  }
}

TEST(Units, AWalkEndsWhereItIsTold) {
  const Unit unit = UnitsOf(SomePyramid(6)).front();
  int calls = 0;
  EXPECT_FALSE(Walk(unit.tiles, {{0, 0, 0}, 6}, [&](const geo::TileKey&) { return ++calls < 3; }));
  EXPECT_EQ(calls, 3);
}

TEST(Shards, HaveEachUnitOnceAndSimilarNumbers) {
  constexpr std::uint32_t kShards = 8;
  std::vector<int> counts(kShards);
  constexpr int kUnits = 4000;
  for (int i = 0; i < kUnits; ++i) {
    const std::string name = "7-" + std::to_string(i % 200) + "-" + std::to_string(i / 200);
    int owners = 0;
    for (std::uint32_t shard = 0; shard < kShards; ++shard) {
      const bool has = Shard{shard, kShards}.Has(name);
      owners += has;
      counts[shard] += has;
    }
    EXPECT_EQ(owners, 1) << name;
  }
  for (const int count : counts) EXPECT_NEAR(count, kUnits / kShards, 100);
}

TEST(Catalogue, RefusesWhatIsNoCell) {
  for (const char* text : {"", "\n\n", "N46E008\nN46", "X46E008", "N90E000", "S91E000", "N46E180", "N46E008x",
                           "N 6E008", "N-6E008", "N46E+08"}) {
    EXPECT_FALSE(PlanCells(text, 1, 0.5)) << text;
  }
  EXPECT_TRUE(PlanCells("N46E008\r\nS90W180\n", 1, 0.5));
}

TEST(Catalogue, CellsHaveTheirTiles) {
  const auto tiles = PlanCells("N46E008\n", 1, 0.5);
  ASSERT_TRUE(tiles);
  EXPECT_EQ(tiles->size(), 16U) << "level 15 for 21 m from west to east";
  const auto& deepest = tiles->back();
  ASSERT_EQ(deepest.size(), 1U);
  const double tile = 180.0 / (1 << 15);
  EXPECT_NEAR(static_cast<double>(deepest[0].start_x) * tile - 180, 8, 2 * tile);
  EXPECT_NEAR(static_cast<double>(deepest[0].end_y + 1) * tile - 90, 47, 2 * tile);
}

}  // namespace
}  // namespace terrace::bake
