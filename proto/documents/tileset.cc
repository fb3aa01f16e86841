#include "proto/documents/tileset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "engine/core/check.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "proto/documents/implicit_tree.h"
#include "proto/documents/subtree.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

// The geometric error of the tileset in metres, which counts while nothing is drawn. CesiumJS requests nothing while
// this is at most 16 pixels, so it must be large enough for every viewing distance.
constexpr double kNothingDrawn = 1e7;

Json Region(const HeightSpan& heights, int level, const geo::TileRange& block) {
  const double tile = std::ldexp(180, -level);
  const auto edge = [&](std::int64_t number, double first) {
    return geo::ToRadians(first + static_cast<double>(number) * tile);
  };
  return {{"region",
           {edge(block.start_x, -180), edge(block.start_y, -90), edge(block.end_x + 1, -180),
            edge(block.end_y + 1, -90), heights.min_m, heights.max_m}}};
}

std::string Query(const TilesetDescription& tileset, const std::string& parameters) {
  std::string query = tileset.version.empty() || !tileset.has_versioned_urls ? "" : "v=" + tileset.version;
  if (!query.empty() && !parameters.empty()) query += '&';
  query += parameters;
  return query.empty() ? "" : "?" + query;
}

// `place`: the tile of the tree, or the template, that the content belongs to.
Json Tile(const TilesetDescription& tileset, const geo::TileKey& root, Json bounds, const char* place) {
  Json json;
  json["boundingVolume"] = std::move(bounds);
  json["geometricError"] = GeometricError(root.level);
  json["refine"] = "REPLACE";
  json["content"]["uri"] =
      fmt::format("3dtiles/{}/{}.glb{}", RootName(root), place, Query(tileset, tileset.content_query));
  return json;
}

Json ImplicitRoot(const TilesetDescription& tileset, const TreeRoot& tree, const HeightSpan& heights) {
  const geo::TileKey& root = tree.tile;
  const int subtree_levels = SubtreeLevels(tree.levels);
  Json json = Tile(tileset, root, Region(heights, root.level, {root.x, root.y, root.x, root.y}), "{level}/{x}/{y}");
  Json& tiling = json["implicitTiling"];
  tiling["subdivisionScheme"] = "QUADTREE";
  tiling["availableLevels"] = tree.levels;
  tiling["subtreeLevels"] = subtree_levels;
  tiling["subtrees"]["uri"] = fmt::format("3dtiles/{}/{{level}}/{{x}}/{{y}}.{}.subtree{}", RootName(root),
                                          subtree_levels, Query(tileset, tileset.subtree_query));
  return json;
}

// Columns are counted eastwards from the end of the widest gap between roots. `end_x` may lie beyond the level's last
// column, across the antimeridian.
geo::TileRange BlockOf(const std::vector<TreeRoot>& roots) {
  const std::int64_t columns = geo::TileColumns(roots.front().tile.level);
  std::set<std::int64_t> used;
  geo::TileRange block{0, roots.front().tile.y, 0, roots.front().tile.y};
  for (const TreeRoot& root : roots) {
    used.insert(root.tile.x);
    block.start_y = std::min(block.start_y, root.tile.y);
    block.end_y = std::max(block.end_y, root.tile.y);
  }
  std::int64_t widest = *used.begin() + columns - *used.rbegin();  // from the last root around to the first
  block.start_x = *used.begin();
  for (auto west = used.begin(), east = std::next(west); east != used.end(); ++west, ++east) {
    if (*east - *west <= widest) continue;
    widest = *east - *west;
    block.start_x = *east;
  }
  block.end_x = block.start_x + columns - widest;
  return block;
}

// A sphere around the middle of the block. Its radius is half the block's width plus half its height along the ground
// plus the range of heights, at most to the other side of the Earth. A block around a pole has its middle at the pole
// and extends to the equator.
Json Sphere(const HeightSpan& heights, int level, const geo::TileRange& block) {
  const double tile = std::ldexp(180, -level);
  const double width = static_cast<double>(block.end_x + 1 - block.start_x) * tile;
  const double south = -90 + static_cast<double>(block.start_y) * tile;
  const double north = -90 + static_cast<double>(block.end_y + 1) * tile;
  if (const double pole = north == 90 ? 90 : -90; width == 360 && (south == -90) != (north == 90)) {
    const geo::Vec3 middle = geo::ToEcef(0, pole, heights.min_m);
    const double rim_latitude = pole > 0 ? std::min(south, 0.0) : std::max(north, 0.0);
    const geo::Vec3 rim = geo::ToEcef(0, rim_latitude, heights.max_m);
    const double relief = heights.max_m - heights.min_m;
    return {{"sphere", {middle.x, middle.y, middle.z, geo::Length(rim - middle) + relief}}};
  }
  const double longitude = -180 + static_cast<double>(block.start_x) * tile + width / 2;
  const geo::Vec3 middle = geo::ToEcef(longitude, (south + north) / 2, heights.min_m);
  const double along = geo::kLargestRadius * geo::ToRadians(width / 2 + (north - south) / 2);
  const double across = geo::Length(middle) + geo::kSemiMajorAxis;
  const double radius = std::min(along, across) + heights.max_m - heights.min_m;
  return {{"sphere", {middle.x, middle.y, middle.z, radius}}};
}

// A sphere around the middle of a tile of 45 degrees beside a pole. It reaches the corners away from the pole, which
// are the farthest.
Json TileSphere(const HeightSpan& heights, const geo::TileKey& key) {
  const double tile = std::ldexp(180, -key.level);
  const auto point = [&](double columns, double rows, double height) {
    return geo::ToEcef(-180 + tile * (static_cast<double>(key.x) + columns),
                       -90 + tile * (static_cast<double>(key.y) + rows), height);
  };
  const geo::Vec3 middle = point(.5, .5, 0);
  double radius = 0;
  for (const double height : {heights.min_m, heights.max_m}) {
    for (const double row : {0, 1}) radius = std::max(radius, geo::Length(point(0, row, height) - middle));
  }
  return {{"sphere", {middle.x, middle.y, middle.z, radius}}};
}

// 3DTilesRendererJS interprets a region with west > east as the other side of the Earth, CesiumJS does not support
// longitudes beyond 180 degrees, and the box that loaders.gl makes of a hemisphere's region does not contain most of
// it.
Json BoundsOf(const std::vector<TreeRoot>& roots, const HeightSpan& heights) {
  const int level = roots.front().tile.level;
  const geo::TileRange block = BlockOf(roots);
  const bool crosses = block.end_x >= geo::TileColumns(level);
  const bool wide = level <= kShallowestRoots;
  return crosses || wide ? Sphere(heights, level, block) : Region(heights, level, block);
}

struct NamedTile {
  Json json;
  HeightSpan heights;  // including those of all tiles below it
};

NamedTile TreeOrTile(const TilesetDescription& tileset, const TreeRoot& tree) {
  const geo::TileKey& key = tree.tile;
  HeightSpan heights = tileset.heights(key);
  if (tree.below.empty()) return {ImplicitRoot(tileset, tree, heights), heights};
  Json children = Json::array();
  for (const TreeRoot& root : tree.below) {
    NamedTile child = TreeOrTile(tileset, root);
    heights.Add(child.heights);
    children.push_back(std::move(child.json));
  }
  const bool is_beside_pole = key.y == 0 || key.y + 1 == geo::TileRows(key.level);
  Json bounds = is_beside_pole && key.level <= kShallowestRoots
                    ? TileSphere(heights, key)
                    : Region(heights, key.level, {key.x, key.y, key.x, key.y});
  NamedTile tile{Tile(tileset, key, std::move(bounds), "0/0/0"), heights};
  tile.json["children"] = std::move(children);
  return tile;
}

Json Root(const TilesetDescription& tileset) {
  NamedTile first = TreeOrTile(tileset, tileset.roots[0]);
  if (tileset.roots.size() == 1) return std::move(first.json);
  HeightSpan heights = first.heights;
  Json children = Json::array({std::move(first.json)});
  for (std::size_t i = 1; i < tileset.roots.size(); ++i) {
    NamedTile child = TreeOrTile(tileset, tileset.roots[i]);
    heights.Add(child.heights);
    children.push_back(std::move(child.json));
  }
  Json json;
  json["boundingVolume"] = BoundsOf(tileset.roots, heights);
  json["geometricError"] = kNothingDrawn;
  json["refine"] = "REPLACE";
  json["children"] = std::move(children);
  return json;
}

// The schema of the metadata in subtrees (OGC 22-025r4, "3D Metadata Semantics"). CesiumJS reads it.
Json Schema() {
  Json properties;
  for (const auto& [name, semantic] :
       {std::pair(kMinHeightProperty, "TILE_MINIMUM_HEIGHT"), std::pair(kMaxHeightProperty, "TILE_MAXIMUM_HEIGHT")}) {
    properties[name] = {{"type", "SCALAR"}, {"componentType", "FLOAT32"}, {"semantic", semantic}};
  }
  return {{"id", "terrace"}, {"classes", {{kTileClass, {{"properties", properties}}}}}};
}

}  // namespace

double GeometricError(int level) {
  constexpr double kTilesetPixels = 16, kTerrainPixels = 2;
  return kTilesetPixels / kTerrainPixels * geo::LevelError(level);
}

std::string EncodeTileset(const TilesetDescription& tileset) {
  TERRACE_CHECK(!tileset.roots.empty());
  Json json;
  json["asset"]["version"] = "1.1";
  if (!tileset.version.empty()) json["asset"]["tilesetVersion"] = tileset.version;
  if (!tileset.attribution.empty()) {
    // The schema has no place for a credit; this is where CesiumJS looks for one.
    json["asset"]["extras"]["cesium"]["credits"] = Json::array({{{"html", tileset.attribution}}});
  }
  json["schema"] = Schema();
  json["geometricError"] = kNothingDrawn;
  json["root"] = Root(tileset);
  // Attributions come from files: bytes that are not UTF-8 become U+FFFD instead of an exception.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace terrace::proto
