// The tiles of a dataset as implicit quadtrees of 3D Tiles 1.1 (OGC 22-025r4, "Implicit Tiling"): where the trees are
// rooted, and what lies in a subtree of them. Pure functions, thread-safe.
//
// A tree is rooted at a TMS tile. Inside it a tile has the level, column and row that it has under that root: level 0
// is the root, x counts from the west and y from the SOUTH, as in TMS, so that the numbers differ by a shift alone.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::proto {

// By level, from 0: what dem::DemSource::Available gives, every ancestor of an available tile included.
using Availability = std::span<const std::vector<geo::TileRange>>;

inline constexpr std::int64_t kMaxImplicitRoots = 4;

// Tiles of 45 degrees. Roots of a larger part of the Earth are of this level, 32 of them at most: descendants inherit
// the skirts of a root, and loaders.gl cannot bound larger regions (docs/decisions/0009-implicit-roots.md).
inline constexpr int kShallowestRoots = 2;

// All tiles of the deepest level that has at most kMaxImplicitRoots of them and under which everything lies, or of
// level kShallowestRoots, or of the deepest level, if that comes first; from west to east, then from south to north.
// Precondition: level 0 is not empty.
std::vector<geo::TileKey> ImplicitRoots(Availability available);

// Levels from the root down to the deepest available tile under it, the root counted: of a mosaic, trees over its fine
// sources are deeper than others. Precondition: the root is available.
int LevelsUnder(Availability available, const geo::TileKey& root);

// More would cost CesiumJS frames: it makes an object for each of the 5,461 tiles of a full subtree as soon as the file
// is there.
inline constexpr int kTallestSubtree = 7;

// Levels of each .subtree of a tree of `levels` levels: as few subtrees one above the other as can be, of equal height.
// A low last one is what must not be: loaders.gl fetches all subtrees of a tree one after the other before it draws,
// and those that begin at the tree's last level are as many as its tiles.
int SubtreeLevels(int levels);

struct TreeRoot {
  geo::TileKey tile;
  int levels = 1;  // of the tree, its root counted
  // Not empty: no tree is rooted at `tile`, which is a tile of its own, but at each of these below it.
  std::vector<TreeRoot> below = {};
};

// Tiles that a tileset.json names one by one, roots of trees included: 350 bytes each, 20 to 30 compressed.
inline constexpr std::size_t kMaxNamedTiles = 1024;

// The roots with what is below them. Two kinds of trees are rooted deeper, under tiles with regions of their own:
// - those beside the poles, by a level: of a region whose corner is a pole loaders.gl makes a box without width, and
//   deck.gl then draws nothing of Europe from near;
// - those of more levels than a subtree, as deep as kMaxNamedTiles allows, trees of most levels first. Descendants
//   inherit the root's range of heights and skirts, which six levels below it are 8 % of the distance from which they
//   are looked at, and twice that with each further level.
std::vector<TreeRoot> ImplicitTrees(Availability available, const std::vector<geo::TileKey>& roots);

// How a root is called in URLs: "9-272-359", level, column and row.
std::string RootName(const geo::TileKey& root);

// The tile `level` levels under the root, in the tree's own numbering.
constexpr geo::TileKey TileUnder(const geo::TileKey& root, int level, std::int64_t x, std::int64_t y) {
  return {root.level + level, (root.x << level) + x, (root.y << level) + y};
}

// Entry k, 0 .. depth: blocks of the available tiles k levels below `top`, numbered from top's south-western corner.
// Levels below the deepest available one are empty.
std::vector<std::vector<geo::TileRange>> BlocksBelow(Availability available, const geo::TileKey& top, int depth);

}  // namespace terrace::proto
