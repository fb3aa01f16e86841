// The 3D Tiles documents of a dataset's GLB tiles: tileset and subtrees. The server and exports of archives use them.
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/geo/tile_key.h"
#include "proto/documents/implicit_tree.h"

namespace terrace::tiler {

// The tiles of a dataset and the heights in them. `available` must outlive it.
struct TileTree {
  std::string version, attribution;
  const std::vector<std::vector<geo::TileRange>>& available;  // by level, from 0
  dem::GeoBounds bounds;                                      // of the data; west > east: across the antimeridian
  double error_fraction = 0.5;
  int deepest_level = 0;                                       // of the sources, without edits; skirts depend on it
  std::function<dem::HeightRange(const geo::TileKey&)> range;  // contains all samples of a tile
  std::function<int(int level)> error_step;                    // of a level's tiles on its ladder
};

// The implicit trees, and the tiles above them, which tileset.json lists one by one. `available` has tiles on level 0.
std::vector<proto::TreeRoot> TreesOf(const TileTree& tree);

// tileset.json. The queries, which may be empty, are appended to the URLs of contents and subtrees. `has_versions`: the
// version, as parameter `v`, precedes them.
std::string TilesetJson(const TileTree& tree, const std::vector<proto::TreeRoot>& roots,
                        const std::string& content_query, const std::string& subtree_query, bool has_versions = true);

// The subtree of `levels` levels below `top`, an available tile. The ranges of heights of an archive take long, because
// its tiles are read for them: after a stop was requested, the result is incomplete and must be dropped.
std::string SubtreeOf(const TileTree& tree, const geo::TileKey& top, int levels, const std::stop_token& stop);

}  // namespace terrace::tiler
