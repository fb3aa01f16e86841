#include "proto/mesh/tile_metadata.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/geo/tile_cover.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

// The part of `ranges`, of tiles of `level`, that lies in `key`. The text depends on these tiles alone, and not on how
// the tiles beside them divide them into ranges.
Json Below(const std::vector<geo::TileRange>& ranges, const geo::TileKey& key, int level) {
  Json below = Json::array();
  for (const geo::TileRange& part : geo::RangesBelow(ranges, key, level)) {
    below.push_back({{"startX", part.start_x}, {"startY", part.start_y}, {"endX", part.end_x}, {"endY", part.end_y}});
  }
  return below;
}

}  // namespace

bool CarriesMetadata(const geo::TileKey& key, int metadata_availability, int max_source_level,
                     std::span<const std::vector<geo::TileRange>> available) {
  if (metadata_availability <= 0 || key.level % metadata_availability != 0) return false;
  if (key.level < max_source_level) return true;
  const int below = key.level + 1;
  return below < static_cast<int>(available.size()) &&
         std::ranges::any_of(available[static_cast<std::size_t>(below)], [&](const geo::TileRange& range) {
           return !geo::IsEmpty(geo::Intersection(range, geo::TilesBelow(key, below)));
         });
}

std::string EncodeTileMetadata(const geo::TileKey& key, std::span<const std::vector<geo::TileRange>> available,
                               int metadata_availability) {
  const int deepest = std::min(key.level + metadata_availability, static_cast<int>(available.size()) - 1);
  Json levels = Json::array();
  for (int level = key.level + 1; level <= deepest; ++level) {
    levels.push_back(Below(available[static_cast<std::size_t>(level)], key, level));
  }
  return Json{{"available", std::move(levels)}}.dump();
}

}  // namespace terrace::proto
