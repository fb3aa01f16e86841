#include "proto/tileset.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/core/check.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/error_ladder.h"
#include "proto/implicit_tree.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

// Metres. What is missing while nothing is drawn: CesiumJS asks for nothing at all while this comes to 16 pixels or
// less, so it must be large enough for any distance from which the Earth is looked at.
constexpr double kNothingDrawn = 1e7;

Json Region(const TilesetDescription& tileset, const geo::TileRange& block) {
  const double tile = std::ldexp(180, -tileset.roots.front().level);
  const auto edge = [&](std::int64_t number, double first) {
    return geo::ToRadians(first + static_cast<double>(number) * tile);
  };
  return {{"region",
           {edge(block.start_x, -180), edge(block.start_y, -90), edge(block.end_x + 1, -180),
            edge(block.end_y + 1, -90), tileset.min_height_m, tileset.max_height_m}}};
}

Json ImplicitRoot(const TilesetDescription& tileset, const geo::TileKey& root) {
  const std::string tile = "3dtiles/" + RootName(root) + "/{level}/{x}/{y}";
  Json json;
  json["boundingVolume"] = Region(tileset, {root.x, root.y, root.x, root.y});
  json["geometricError"] = GeometricError(root.level);
  json["refine"] = "REPLACE";
  json["content"]["uri"] = tile + ".glb" + (tileset.content_query.empty() ? "" : "?" + tileset.content_query);
  Json& tiling = json["implicitTiling"];
  tiling["subdivisionScheme"] = "QUADTREE";
  tiling["availableLevels"] = tileset.levels;
  tiling["subtreeLevels"] = tileset.subtree_levels;
  tiling["subtrees"]["uri"] = tile + ".subtree";
  return json;
}

// Columns 0 and the last one next to each other lie across the antimeridian. Their region goes all the way round: not
// every client reads a region whose west is greater than its east.
geo::TileRange BlockOf(const std::vector<geo::TileKey>& roots) {
  geo::TileRange block{roots[0].x, roots[0].y, roots[0].x, roots[0].y};
  for (const geo::TileKey& root : roots) {
    block = {std::min(block.start_x, root.x), std::min(block.start_y, root.y), std::max(block.end_x, root.x),
             std::max(block.end_y, root.y)};
  }
  return block;
}

Json Root(const TilesetDescription& tileset) {
  if (tileset.roots.size() == 1) return ImplicitRoot(tileset, tileset.roots[0]);
  Json json;
  json["boundingVolume"] = Region(tileset, BlockOf(tileset.roots));
  json["geometricError"] = kNothingDrawn;
  json["refine"] = "REPLACE";
  json["children"] = Json::array();
  for (const geo::TileKey& root : tileset.roots) json["children"].push_back(ImplicitRoot(tileset, root));
  return json;
}

// CesiumJS shows credits as HTML.
std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else {
      escaped += c;
    }
  }
  return escaped;
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
  if (!tileset.attribution.empty()) {
    // The schema has no place for a credit; this is where CesiumJS looks for one.
    json["asset"]["extras"]["cesium"]["credits"] = Json::array({{{"html", EscapeHtml(tileset.attribution)}}});
  }
  json["geometricError"] = kNothingDrawn;
  json["root"] = Root(tileset);
  // Attributions come from files: bytes that are not UTF-8 become U+FFFD instead of an exception.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace terrace::proto
