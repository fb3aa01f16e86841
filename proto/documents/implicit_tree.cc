#include "proto/documents/implicit_tree.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <numeric>
#include <set>
#include <utility>

#include "engine/core/check.h"
#include "engine/geo/tile_cover.h"

namespace terrace::proto {
namespace {

std::int64_t Count(const std::vector<geo::TileRange>& ranges) {
  return std::accumulate(ranges.begin(), ranges.end(), std::int64_t{0},
                         [](std::int64_t sum, const geo::TileRange& range) { return sum + geo::Cells(range); });
}

std::vector<geo::TileKey> TilesOf(Availability available, int level) {
  std::vector<geo::TileKey> tiles;
  for (const geo::TileRange& range : available[static_cast<std::size_t>(level)]) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) tiles.push_back({level, x, y});
    }
  }
  return tiles;
}

// Whether the tiles are few and contain all data: a local raster in a mosaic with the globe does not.
bool CanBeRoots(Availability available, int level) {
  if (Count(available[static_cast<std::size_t>(level)]) > kMaxImplicitRoots) return false;
  const std::vector<geo::TileKey> tiles = TilesOf(available, level);
  for (int up = 1; level - up >= kShallowestRoots; ++up) {
    std::set<std::pair<std::int64_t, std::int64_t>> ancestors;
    for (const geo::TileKey& tile : tiles) ancestors.emplace(tile.x >> up, tile.y >> up);
    const auto count = static_cast<std::int64_t>(ancestors.size());
    if (Count(available[static_cast<std::size_t>(level - up)]) > count) return false;
  }
  return true;
}

// The tiles `k` levels below `top` that are in `range`, numbered from top's south-western corner; may be empty.
geo::TileRange PartUnder(const geo::TileRange& range, const geo::TileKey& top, int k) {
  const std::int64_t last = (std::int64_t{1} << k) - 1;
  const geo::TileKey corner = TileUnder(top, k, 0, 0);
  return {std::max<std::int64_t>(range.start_x - corner.x, 0), std::max<std::int64_t>(range.start_y - corner.y, 0),
          std::min(range.end_x - corner.x, last), std::min(range.end_y - corner.y, last)};
}

// The blocks that intersect the area of `top`, not clipped. Levels above `top` are empty.
std::vector<std::vector<geo::TileRange>> BlocksThatReachUnder(Availability available, const geo::TileKey& top) {
  std::vector<std::vector<geo::TileRange>> blocks(available.size());
  for (auto level = static_cast<std::size_t>(top.level); level < available.size(); ++level) {
    const int k = static_cast<int>(level) - top.level;
    std::ranges::copy_if(available[level], std::back_inserter(blocks[level]),
                         [&](const geo::TileRange& range) { return !geo::IsEmpty(PartUnder(range, top, k)); });
  }
  return blocks;
}

// The children of a tile as roots of trees; empty if it has none.
std::vector<TreeRoot> TreesBelow(Availability available, const geo::TileKey& tile) {
  const std::vector<std::vector<geo::TileRange>> here = BlocksThatReachUnder(available, tile);
  const std::vector<std::vector<geo::TileRange>> blocks = BlocksBelow(here, tile, 1);
  std::vector<TreeRoot> trees;
  for (const geo::TileRange& block : blocks[1]) {
    for (std::int64_t y = block.start_y; y <= block.end_y; ++y) {
      for (std::int64_t x = block.start_x; x <= block.end_x; ++x) {
        const geo::TileKey child = TileUnder(tile, 1, x, y);
        trees.push_back({child, LevelsUnder(here, child)});
      }
    }
  }
  return trees;
}

std::size_t CountTiles(const std::vector<TreeRoot>& trees) {
  std::size_t count = trees.size();
  for (const TreeRoot& tree : trees) count += CountTiles(tree.below);
  return count;
}

// Pointers stay valid as long as nothing is added to the vectors that contain their targets.
void FindTrees(std::vector<TreeRoot>& trees, int levels, std::vector<TreeRoot*>& found) {
  for (TreeRoot& tree : trees) {
    if (!tree.below.empty()) {
      FindTrees(tree.below, levels, found);
    } else if (tree.levels == levels) {
      found.push_back(&tree);
    }
  }
}

// Trees with the same number of levels are split together, so that neighbours are treated alike.
void SplitTallTrees(Availability available, std::vector<TreeRoot>& trees) {
  std::size_t named = CountTiles(trees);
  for (int levels = static_cast<int>(available.size()); levels > kMaxServedSubtreeLevels; --levels) {
    std::vector<TreeRoot*> tall;
    FindTrees(trees, levels, tall);
    std::vector<std::vector<TreeRoot>> below;
    for (const TreeRoot* tree : tall) {
      named += below.emplace_back(TreesBelow(available, tree->tile)).size();
      if (named > kMaxNamedTiles) return;
    }
    for (std::size_t i = 0; i < tall.size(); ++i) tall[i]->below = std::move(below[i]);
  }
}

}  // namespace

std::vector<geo::TileKey> ImplicitRoots(Availability available) {
  TERRACE_CHECK(!available.empty() && !available[0].empty());
  auto level = static_cast<int>(available.size()) - 1;
  while (available[static_cast<std::size_t>(level)].empty()) --level;
  while (level > kShallowestRoots && !CanBeRoots(available, level)) --level;
  std::vector<geo::TileKey> roots = TilesOf(available, level);
  std::sort(roots.begin(), roots.end(),
            [](const geo::TileKey& a, const geo::TileKey& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  return roots;
}

int LevelsUnder(Availability available, const geo::TileKey& root) {
  for (int level = static_cast<int>(available.size()) - 1; level >= root.level; --level) {
    const int k = level - root.level;
    const auto& ranges = available[static_cast<std::size_t>(level)];
    const auto is_under = [&](const geo::TileRange& range) { return !geo::IsEmpty(PartUnder(range, root, k)); };
    if (std::ranges::any_of(ranges, is_under)) return k + 1;
  }
  TERRACE_CHECK(false);
  return 0;
}

std::vector<TreeRoot> ImplicitTrees(Availability available, const std::vector<geo::TileKey>& roots) {
  std::vector<TreeRoot> trees;
  for (const geo::TileKey& tile : roots) {
    TreeRoot& tree = trees.emplace_back(TreeRoot{tile, LevelsUnder(available, tile)});
    const bool is_beside_pole = tile.y == 0 || tile.y + 1 == geo::TileRows(tile.level);
    if (tile.level == kShallowestRoots && is_beside_pole) tree.below = TreesBelow(available, tile);
  }
  SplitTallTrees(available, trees);
  return trees;
}

int SubtreeLevels(int levels) {
  const int stacked = (levels + kMaxServedSubtreeLevels - 1) / kMaxServedSubtreeLevels;
  return (levels + stacked - 1) / stacked;
}

std::string RootName(const geo::TileKey& root) { return fmt::format("{}-{}-{}", root.level, root.x, root.y); }

std::vector<std::vector<geo::TileRange>> BlocksBelow(Availability available, const geo::TileKey& top, int depth) {
  std::vector<std::vector<geo::TileRange>> blocks(static_cast<std::size_t>(depth) + 1);
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const std::size_t level = static_cast<std::size_t>(top.level) + k;
    if (level >= available.size()) break;
    for (const geo::TileRange& range : available[level]) {
      const geo::TileRange here = PartUnder(range, top, static_cast<int>(k));
      if (!geo::IsEmpty(here)) blocks[k].push_back(here);
    }
  }
  return blocks;
}

}  // namespace terrace::proto
