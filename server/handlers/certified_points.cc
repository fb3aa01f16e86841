#include "server/handlers/certified_points.h"

#include <algorithm>
#include <cmath>

namespace terrace::server {
namespace {

// A point on the edge between two tiles belongs to the eastern and to the northern tile.
geo::TileKey TileAt(const dem::GeoPosition& point, int level) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  const auto number = [side](double degrees, std::int64_t count) {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(degrees / side)), 0, count - 1);
  };
  const double longitude = point.longitude == 180 ? -180 : point.longitude;
  return {level, number(longitude + 180, geo::TileColumns(level)), number(point.latitude + 90, geo::TileRows(level))};
}

}  // namespace

Result<CertifiedPoints> TilesOf(const DatasetView& dataset, std::span<const dem::GeoPosition> points, int deepest,
                                const std::stop_token& stop) {
  CertifiedPoints certified;
  for (const dem::GeoPosition& point : points) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the tiles any more");
    int level = std::min(deepest, dataset.max_level());
    geo::TileKey key = TileAt(point, level);
    while (level > 0 && !IsAvailable(dataset, key)) key = TileAt(point, --level);
    auto known = std::ranges::find(certified.tiles, key);
    if (known == certified.tiles.end()) {
      if (certified.tiles.size() == kMaxCertifiedTiles) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "certify: the points lie in more than {} tiles, which is the most this server certifies at "
                         "once; ask for fewer points, or for a shallower level",
                         kMaxCertifiedTiles);
      }
      known = certified.tiles.insert(certified.tiles.end(), key);
    }
    certified.tile_of_point.push_back(static_cast<std::size_t>(known - certified.tiles.begin()));
  }
  certified.errors_m.resize(certified.tiles.size());
  return certified;
}

}  // namespace terrace::server
