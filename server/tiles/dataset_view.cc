#include "server/tiles/dataset_view.h"

#include <algorithm>

#include "engine/geo/mercator_grid.h"

namespace terrace::server {

bool IsAvailable(const DatasetView& dataset, const geo::TileKey& key) {
  if (!geo::IsValid(key) || key.level > dataset.max_level()) return false;
  const auto& ranges = dataset.available[static_cast<std::size_t>(key.level)];
  return std::any_of(ranges.begin(), ranges.end(), [&](const geo::TileRange& range) { return range.Contains(key); });
}

bool IsHeightTileAvailable(const DatasetView& dataset, const geo::TileKey& key, int size) {
  if (key.level < 0 || key.level > MaxHeightLevel(dataset, size)) return false;
  const std::int64_t tiles = std::int64_t{1} << key.level;
  if (key.x < 0 || key.x >= tiles || key.y < 0 || key.y >= tiles) return false;
  const auto share = [&](std::int64_t edge) { return static_cast<double>(edge) / static_cast<double>(tiles); };
  if (geo::MercatorLatitude(share(key.y)) < dataset.south || geo::MercatorLatitude(share(key.y + 1)) > dataset.north) {
    return false;
  }
  const double west = share(key.x) * 360 - 180, east = share(key.x + 1) * 360 - 180;
  if (dataset.west > dataset.east) return west <= dataset.east || east >= dataset.west;
  return west <= dataset.east && east >= dataset.west;
}

int MaxHeightLevel(const DatasetView& dataset, int size) { return dataset.max_mercator_depth - (size == 512 ? 1 : 0); }

}  // namespace terrace::server
