// tileset.json of 3D Tiles 1.1: implicit quadtrees over TMS tiles (OGC 22-025r4). Independent of the tiles' content.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "proto/documents/implicit_tree.h"
#include "proto/height_span.h"

namespace terrace::proto {

struct TilesetDescription {
  std::string version;             // of the tiles, [0-9A-Za-z._~-]; empty: none
  bool has_versioned_urls = true;  // the version is the first parameter of every URL
  std::string attribution;
  std::vector<TreeRoot> roots;  // tiles of one level (ImplicitTrees)
  // The range of a tile and, if a tree is rooted at it, of all its descendants, because clients apply a root's range to
  // them. The written range of a tile also contains those of the tiles below it.
  std::function<HeightSpan(const geo::TileKey&)> heights;
  std::string subtree_query;  // appended to the subtree templates, without '?'; may be empty
  std::string content_query;  // the same for the content templates: "error=5&atleast=1"
};

// Metres. 3D Tiles clients refine a tile if its geometric error is more than 16 pixels on the screen; terrain clients
// refine if the level error that they assume is more than 2 pixels. With 8 times that level error both choose the same
// tiles (cesium-native converts layer.json to 3D Tiles by the same factor).
double GeometricError(int level);

// UTF-8 JSON. Templates are relative to the tileset: 3dtiles/ROOT/{level}/{x}/{y}.glb and
// 3dtiles/ROOT/{level}/{x}/{y}.N.subtree (ROOT: RootName, N: SubtreeLevels), so that an older tileset.json still works
// if the tree has another number of levels now. Several roots become children of a tile without content. The schema is
// that of the subtrees' metadata (proto/documents/subtree.h).
std::string EncodeTileset(const TilesetDescription& tileset);

}  // namespace terrace::proto
