#include "proto/mesh/tile_metadata.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

// The part of `ranges`, `down` levels below `key`, that lies in the tile.
Json Below(const std::vector<geo::TileRange>& ranges, const geo::TileKey& key, int down) {
  Json below = Json::array();
  const geo::TileRange tile{key.x << down, key.y << down, ((key.x + 1) << down) - 1, ((key.y + 1) << down) - 1};
  for (const geo::TileRange& range : ranges) {
    const geo::TileRange part{std::max(range.start_x, tile.start_x), std::max(range.start_y, tile.start_y),
                              std::min(range.end_x, tile.end_x), std::min(range.end_y, tile.end_y)};
    if (part.start_x > part.end_x || part.start_y > part.end_y) continue;
    below.push_back({{"startX", part.start_x}, {"startY", part.start_y}, {"endX", part.end_x}, {"endY", part.end_y}});
  }
  return below;
}

}  // namespace

bool CarriesMetadata(int level, int metadata_levels, int max_level) {
  return metadata_levels > 0 && level % metadata_levels == 0 && level < max_level;
}

std::string EncodeTileMetadata(const geo::TileKey& key, const std::vector<std::vector<geo::TileRange>>& available,
                               int metadata_levels) {
  const int deepest = std::min(key.level + metadata_levels, static_cast<int>(available.size()) - 1);
  Json levels = Json::array();
  for (int level = key.level + 1; level <= deepest; ++level) {
    levels.push_back(Below(available[static_cast<std::size_t>(level)], key, level - key.level));
  }
  return Json{{"available", std::move(levels)}}.dump();
}

}  // namespace terrace::proto
