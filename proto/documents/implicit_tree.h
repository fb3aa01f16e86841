// The tiles of a dataset as implicit quadtrees of 3D Tiles 1.1 (OGC 22-025r4, "Implicit Tiling"): where the trees are
// rooted, and what lies in a subtree of them. Pure functions, thread-safe.
//
// A tree is rooted at a TMS tile. A tile's level, column and row in the tree are relative to the root: level 0 is the
// root, x counts from the west and y from the SOUTH, as in TMS.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::proto {

// The result of dem::ElevationModel::Available by level, from 0. Includes every ancestor of an available tile.
using Availability = std::span<const std::vector<geo::TileRange>>;

inline constexpr std::int64_t kMaxImplicitRoots = 4;

// Level of tiles of 45 degrees. If the data cover too much of the Earth for deeper roots, the roots are at this level,
// at most 32 of them: descendants inherit the skirts of a root, and loaders.gl cannot bound larger regions
// (docs/decisions/0009-implicit-roots.md).
inline constexpr int kShallowestRoots = 2;

// Returns all tiles of one level, from west to east, then from south to north. It is the deepest level with at most
// kMaxImplicitRoots tiles that together contain all deeper tiles; but at least kShallowestRoots, and at most the
// deepest level with tiles. Precondition: level 0 is not empty.
std::vector<geo::TileKey> ImplicitRoots(Availability available);

// The number of levels from the root to the deepest available tile below it, both included. In a mosaic, trees over
// fine sources have more levels than others. Precondition: the root is available.
int LevelsUnder(Availability available, const geo::TileKey& root);

// With more levels CesiumJS would miss frames: it creates an object for each of the 5,461 tiles of a full subtree when
// the file arrives.
inline constexpr int kMaxServedSubtreeLevels = 7;

// The number of levels of each .subtree in a tree of `levels` levels, at most kMaxServedSubtreeLevels: the smallest one
// for which a path from the root to the deepest tile crosses as few subtrees as possible. Equal numbers keep the
// subtrees few: loaders.gl fetches all of them, one by one, before it draws.
int SubtreeLevels(int levels);

struct TreeRoot {
  geo::TileKey tile;
  int levels = 1;  // of the tree, its root counted
  // If not empty, `tile` is a single tile without a tree, and trees are rooted at these tiles below it.
  std::vector<TreeRoot> below = {};
};

// Limit of the tiles that a tileset.json lists explicitly, roots included. Each takes 350 bytes, compressed 20 to 30.
inline constexpr std::size_t kMaxNamedTiles = 1024;

// The roots, with the roots below them. Two kinds of trees are rooted deeper, below tiles with their own regions:
// - trees beside a pole, by one level: for a region with a corner at a pole loaders.gl makes a box without width, and
//   deck.gl then draws nothing of Europe from nearby;
// - trees with more levels than a subtree, as deep as kMaxNamedTiles allows, those with the most levels first.
//   Descendants inherit the root's height range and skirts. Six levels below the root the skirts are 8 % of the viewing
//   distance, and twice as much with each further level.
std::vector<TreeRoot> ImplicitTrees(Availability available, const std::vector<geo::TileKey>& roots);

// The name of a root in URLs: level, column and row, as in "9-272-359".
std::string RootName(const geo::TileKey& root);

// The tile at a tree's own level, column and row.
constexpr geo::TileKey TileUnder(const geo::TileKey& root, int level, std::int64_t x, std::int64_t y) {
  return {root.level + level, (root.x << level) + x, (root.y << level) + y};
}

// Entry k, 0 .. depth: blocks of the available tiles k levels below `top`, numbered from top's south-western corner.
// Levels below the deepest available one are empty.
std::vector<std::vector<geo::TileRange>> BlocksBelow(Availability available, const geo::TileKey& top, int depth);

}  // namespace terrace::proto
