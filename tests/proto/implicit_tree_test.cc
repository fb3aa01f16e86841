#include "proto/documents/implicit_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace terrace::proto {
namespace {

using Levels = std::vector<std::vector<geo::TileRange>>;
using Keys = std::vector<geo::TileKey>;

// The tiles of a dataset whose deepest tiles are `deepest`: those, all ancestors, and both roots.
Levels Above(const std::vector<geo::TileRange>& deepest, int max_level) {
  Levels levels(static_cast<std::size_t>(max_level) + 1);
  for (int level = 1; level <= max_level; ++level) {
    const int up = max_level - level;
    for (const geo::TileRange& r : deepest) {
      levels[static_cast<std::size_t>(level)].push_back(
          {r.start_x >> up, r.start_y >> up, r.end_x >> up, r.end_y >> up});
    }
  }
  levels[0] = {{0, 0, 1, 0}};
  return levels;
}

std::vector<TreeRoot> TreesOf(const Levels& available) { return ImplicitTrees(available, ImplicitRoots(available)); }

TEST(ImplicitRoots, OfTheWholeGlobeAreAllTilesOfLevelTwo) {
  Levels available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}, {{0, 0, 15, 7}}};
  const Keys roots = ImplicitRoots(available);
  ASSERT_EQ(roots.size(), 32u);
  EXPECT_EQ(roots.front(), (geo::TileKey{2, 0, 0}));
  EXPECT_EQ(roots.back(), (geo::TileKey{2, 7, 3}));
  available.resize(2);
  EXPECT_EQ(ImplicitRoots(available).size(), 8u) << "no deeper than the data";
  available.resize(1);
  EXPECT_EQ(ImplicitRoots(available), (Keys{{0, 0, 0}, {0, 1, 0}}));
}

TEST(ImplicitRoots, LieAsDeepAsFourTilesHoldTheData) {
  // 16 x 12 tiles of level 13 fill two by two tiles of level 10, the upper two by half.
  EXPECT_EQ(ImplicitRoots(Above({{32, 64, 47, 75}}, 13)), (Keys{{10, 4, 8}, {10, 5, 8}, {10, 4, 9}, {10, 5, 9}}));
  EXPECT_EQ(ImplicitRoots(Above({{33, 64, 36, 64}}, 13)),
            (Keys{{13, 33, 64}, {13, 34, 64}, {13, 35, 64}, {13, 36, 64}}));
  EXPECT_EQ(ImplicitRoots(Above({{7, 9, 7, 9}}, 13)), (Keys{{13, 7, 9}}));
}

TEST(ImplicitRoots, AcrossLongitudeZeroAndTheAntimeridianStayDeep) {
  // A block that straddles x = 512 of level 9 is in both hemispheres, and the smallest common tile would be the world.
  EXPECT_EQ(ImplicitRoots(Above({{508, 300, 515, 303}}, 9)), (Keys{{7, 127, 75}, {7, 128, 75}}));
  EXPECT_EQ(ImplicitRoots(Above({{0, 300, 3, 303}, {1020, 300, 1023, 303}}, 9)), (Keys{{7, 0, 75}, {7, 255, 75}}));
}

TEST(LevelsUnder, ReachAsDeepAsTheTreesOwnTiles) {
  // Four levels of the globe, and nine over one tile of level 2.
  Levels available = Above({{100, 60, 103, 63}}, 8);
  available[1] = {{0, 0, 3, 1}};
  available[2] = {{0, 0, 7, 3}};
  available[3].push_back({0, 0, 15, 7});
  EXPECT_EQ(LevelsUnder(available, {2, 1, 0}), 7);
  EXPECT_EQ(LevelsUnder(available, {2, 0, 0}), 2);
  EXPECT_EQ(LevelsUnder(available, {8, 100, 60}), 1);
}

TEST(ImplicitRoots, HoldTheGlobeUnderASmallRaster) {
  Levels available = Above({{1000, 700, 1001, 701}}, 9);
  available[1] = {{0, 0, 3, 1}};
  available[2] = {{0, 0, 7, 3}};
  available[3] = {{0, 0, 15, 7}};
  EXPECT_EQ(ImplicitRoots(available).size(), 32u);
}

TEST(ImplicitTrees, BesideThePolesAreRootedALevelDeeper) {
  Levels available = Above({{140, 110, 145, 113}}, 7);  // about 18 degrees east, 67 to 72 north
  available[1] = {{0, 0, 3, 1}};
  available[2] = {{0, 0, 7, 3}};
  available[3] = {{0, 0, 15, 7}};
  const std::vector<TreeRoot> trees = TreesOf(available);
  ASSERT_EQ(trees.size(), 32u);
  for (const TreeRoot& tree : trees) {
    ASSERT_EQ(tree.below.size(), tree.tile.y == 0 || tree.tile.y == 3 ? 4u : 0u) << geo::ToString(tree.tile);
    for (const TreeRoot& root : tree.below) {
      EXPECT_EQ((geo::TileKey{2, root.tile.x / 2, root.tile.y / 2}), tree.tile);
      EXPECT_EQ(root.levels, LevelsUnder(available, root.tile));
    }
  }
  available.resize(3);
  for (const TreeRoot& tree : TreesOf(available)) EXPECT_TRUE(tree.below.empty()) << "nothing below";
  EXPECT_TRUE(TreesOf(Above({{33, 0, 36, 0}}, 13)).front().below.empty()) << "small roots are left alone";
}

// The globe down to `base`, and tiles of `deepest` over a block of it.
Levels GlobeAnd(int base, const geo::TileRange& block, int deepest) {
  Levels available = Above({block}, deepest);
  for (int level = 1; level <= base; ++level) {
    available[static_cast<std::size_t>(level)] = {{0, 0, (2 << level) - 1, (1 << level) - 1}};
  }
  // All four children of a tile that has any.
  for (int level = base + 1; level <= deepest; ++level) {
    geo::TileRange& range = available[static_cast<std::size_t>(level)].front();
    range = {range.start_x & ~1, range.start_y & ~1, range.end_x | 1, range.end_y | 1};
  }
  return available;
}

struct Named {
  std::size_t tiles = 0, trees = 0;
  int tallest = 0;
};

// Checks that what is below a tile are its available children.
void Walk(const Levels& available, const std::vector<TreeRoot>& trees, Named& named) {
  for (const TreeRoot& tree : trees) {
    ++named.tiles;
    ASSERT_EQ(tree.levels, LevelsUnder(available, tree.tile)) << geo::ToString(tree.tile);
    if (tree.below.empty()) {
      ++named.trees;
      named.tallest = std::max(named.tallest, tree.levels);
      continue;
    }
    std::size_t children = 0;
    for (int i = 0; i < 4; ++i) {
      const geo::TileKey child = TileUnder(tree.tile, 1, i % 2, i / 2);
      const auto& level = available[static_cast<std::size_t>(child.level)];
      const auto has_child = [&](const geo::TileRange& range) { return range.Contains(child); };
      const bool is_there = std::any_of(level.begin(), level.end(), has_child);
      children += is_there ? 1 : 0;
      const auto is_child = [&](const TreeRoot& root) { return root.tile == child; };
      EXPECT_EQ(std::count_if(tree.below.begin(), tree.below.end(), is_child), is_there ? 1 : 0);
    }
    EXPECT_EQ(tree.below.size(), children) << geo::ToString(tree.tile);
    Walk(available, tree.below, named);
  }
}

// If a client inherits the heights and skirts of a root far above, it requests twice the tiles.
TEST(ImplicitTrees, AreNoTallerThanASubtreeOverAnIslandOfTheGlobe) {
  const Levels available = GlobeAnd(5, {9000, 9000, 9040, 9030}, 14);
  Named named;
  Walk(available, TreesOf(available), named);
  EXPECT_LE(named.tallest, kMaxServedSubtreeLevels);
  EXPECT_LE(named.tiles, 250u) << "only above the island";
}

TEST(ImplicitTrees, AreNoTallerThanASubtreeOverASmallDataset) {
  const Levels available = Above({{8192, 9216, 8319, 9343}}, 14);
  ASSERT_EQ(ImplicitRoots(available).front().level, 8);
  Levels deeper = available;
  for (int up = 0; up < 3; ++up) {
    deeper.push_back({{deeper.back()[0].start_x * 2, deeper.back()[0].start_y * 2, deeper.back()[0].end_x * 2 + 1,
                       deeper.back()[0].end_y * 2 + 1}});
  }
  for (const Levels& levels : {available, deeper}) {
    Named named;
    Walk(levels, TreesOf(levels), named);
    EXPECT_LE(named.tallest, kMaxServedSubtreeLevels);
  }
}

TEST(ImplicitTrees, OfADeepGlobeAreNamedNoFurtherThanADocumentHolds) {
  const Levels available = GlobeAnd(14, {0, 0, 1, 1}, 14);
  Named named;
  Walk(available, TreesOf(available), named);
  EXPECT_LE(named.tiles, kMaxNamedTiles);
  EXPECT_EQ(named.trees, 512u) << "all of level 4";
  EXPECT_EQ(named.tallest, 11);
}

// loaders.gl requests every subtree of a tree before it draws. 13 levels in subtrees of 6 have one subtree for each
// deepest tile, 24,633 of them for an island.
TEST(SubtreeLevels, AreEqualSoThatTheLastSubtreesAreFew) {
  for (int levels = 1; levels <= geo::kMaxLevel + 1; ++levels) {
    const int each = SubtreeLevels(levels), stacked = (levels + each - 1) / each;
    EXPECT_LE(each, kMaxServedSubtreeLevels) << levels;
    EXPECT_EQ(stacked, (levels + kMaxServedSubtreeLevels - 1) / kMaxServedSubtreeLevels)
        << levels << ": no more one above another";
    EXPECT_GE(levels - (stacked - 1) * each, each - stacked + 1) << levels << ": the last is hardly lower";
  }
  EXPECT_EQ(SubtreeLevels(6), 6);
  EXPECT_EQ(SubtreeLevels(8), 4);
  EXPECT_EQ(SubtreeLevels(13), 7);
}

TEST(ImplicitRoots, AreNamedByLevelColumnAndRow) { EXPECT_EQ(RootName({9, 272, 359}), "9-272-359"); }

TEST(TileUnder, CountsFromTheRootsSouthWesternCorner) {
  EXPECT_EQ(TileUnder({9, 272, 359}, 0, 0, 0), (geo::TileKey{9, 272, 359}));
  EXPECT_EQ(TileUnder({9, 272, 359}, 3, 5, 2), (geo::TileKey{12, 272 * 8 + 5, 359 * 8 + 2}));
}

TEST(BlocksBelow, AreClippedToTheTile) {
  const Levels available = Above({{33, 64, 36, 70}}, 8);
  // Tile 6/8/16 has tiles 32..35 x 64..67 of level 8 below it.
  const Levels blocks = BlocksBelow(available, {6, 8, 16}, 4);
  ASSERT_EQ(blocks.size(), 5u);
  EXPECT_EQ(blocks[0], (std::vector<geo::TileRange>{{0, 0, 0, 0}}));
  EXPECT_EQ(blocks[1], (std::vector<geo::TileRange>{{0, 0, 1, 1}}));
  EXPECT_EQ(blocks[2], (std::vector<geo::TileRange>{{1, 0, 3, 3}}));
  EXPECT_TRUE(blocks[3].empty() && blocks[4].empty()) << "nothing below the deepest level";
}

TEST(BlocksBelow, HoldAnyTileThatIsAvailable) {
  const Levels available = Above({{500, 301, 520, 309}, {530, 301, 533, 309}}, 9);
  const geo::TileKey top{5, 32, 18};
  const Levels blocks = BlocksBelow(available, top, 4);
  for (int k = 0; k <= 4; ++k) {
    for (std::int64_t y = 0; y < 1 << k; ++y) {
      for (std::int64_t x = 0; x < 1 << k; ++x) {
        const geo::TileKey key = TileUnder(top, k, x, y);
        int listed = 0, there = 0;
        for (const auto& range : available[static_cast<std::size_t>(key.level)]) there += range.Contains(key);
        for (const auto& range : blocks[static_cast<std::size_t>(k)]) listed += range.Contains({k, x, y});
        ASSERT_EQ(listed > 0, there > 0) << geo::ToString(key);
      }
    }
  }
}

}  // namespace
}  // namespace terrace::proto
