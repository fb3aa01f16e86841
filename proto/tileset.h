// tileset.json of 3D Tiles 1.1: implicit quadtrees over TMS tiles (OGC 22-025r4). Knows nothing of what a tile
// contains.
#pragma once

#include <string>
#include <vector>

#include "proto/implicit_tree.h"

namespace terrace::proto {

struct TilesetDescription {
  std::string attribution;
  std::vector<TreeRoot> roots;  // tiles of one level (ImplicitTrees)
  // Metres above the ellipsoid that no vertex of any tile leaves, feet of skirts included: clients hand the range of
  // the root down to all its descendants.
  double min_height_m = 0, max_height_m = 0;
  std::string subtree_query;  // appended to the subtree template, likewise; may be empty
  std::string content_query;  // appended to the content templates, without '?': "error=5&atleast=1"; may be empty
};

// Metres. 3D Tiles clients go a level deeper where a tile's geometric error comes to more than 16 pixels, terrain
// clients where the level error that they assume comes to more than 2. With 8 times that level error both choose the
// same tiles (cesium-native turns layer.json into 3D Tiles by the same factor).
double GeometricError(int level);

// UTF-8 JSON. Templates are relative to the tileset: 3dtiles/{RootName}/{level}/{x}/{y}.glb and
// .{SubtreeLevels}.subtree, so that a tileset.json kept from a day when the tree had other levels stays good. Several
// roots become children of a tile without content.
std::string EncodeTileset(const TilesetDescription& tileset);

}  // namespace terrace::proto
