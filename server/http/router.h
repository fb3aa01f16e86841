// From a request target to what it names: the table of all URLs. Pure; knows no dataset.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "engine/geo/tile_key.h"
#include "tiler/tile_request.h"

namespace terrace::server {

enum class RouteKind {
  kTile,      // /{dataset}/{z}/{x}/{y}.terrain, .glb, .png; /{dataset}/3dtiles/{root}/{level}/{x}/{y}.glb
  kLayer,     // /{dataset}/layer.json
  kTileset,   // /{dataset}/tileset.json
  kSubtree,   // /{dataset}/3dtiles/{root}/{level}/{x}/{y}.{levels}.subtree
  kTileJson,  // /{dataset}/tiles.json
  kHeights,   // /{dataset}/heights
  kMesh,      // /{dataset}/mesh
  kDatasets,  // /datasets
  kViewer,    // / and /viewer/...
  kLive,      // /livez
  kReady,     // /readyz
  kMetrics,   // /metrics
};

// A short literal for logs and metrics.
std::string_view ToString(RouteKind kind);

struct Route {
  RouteKind kind = RouteKind::kViewer;
  std::string dataset;     // where the URL begins with one: decoded
  geo::TileKey key;        // kTile, kSubtree: inside the tiling scheme of its format
  geo::TileKey root;       // kSubtree: of the tree the URL counts in, an ancestor of `key`
  int subtree_levels = 0;  // kSubtree: 1 .. proto::kTallestSubtree
  tiler::TileFormat format = tiler::TileFormat::kQuantizedMesh;  // kTile: by the extension
  std::string file;   // kViewer: relative to the viewer's folder, decoded: "index.html" for "/"
  std::string query;  // without '?', not decoded
};

// Whether it answers POST, and so takes a body.
constexpr bool TakesPost(RouteKind kind) { return kind == RouteKind::kHeights; }

// `target` in origin form ("/maui/0/0/0.terrain?error=5") or absolute form ("http://host/...").
// kInvalidArgument: neither form, malformed percent-encoding, or a parameter whose name has any. kNotFound: no such
// URL; tile numbers that are not plain decimal numbers, or lie outside the tiling scheme, name no tile.
Result<Route> Match(std::string_view target);

}  // namespace terrace::server
