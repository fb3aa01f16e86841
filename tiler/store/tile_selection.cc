#include "tiler/store/tile_selection.h"

#include "engine/geo/mercator_grid.h"

namespace terrace::tiler {
namespace {

dem::GeoBounds BoundsOf(const geo::TileKey& key, bool is_mercator) {
  const auto columns = static_cast<double>(is_mercator ? geo::TileRows(key.level) : geo::TileColumns(key.level));
  const auto rows = static_cast<double>(geo::TileRows(key.level));
  const auto longitude = [&](std::int64_t x) { return 360 * static_cast<double>(x) / columns - 180; };
  const auto share = [&](std::int64_t y) { return static_cast<double>(y) / rows; };
  dem::GeoBounds bounds{longitude(key.x), 180 * share(key.y) - 90, longitude(key.x + 1), 180 * share(key.y + 1) - 90};
  if (is_mercator) {  // y counts from the north
    bounds.south = geo::MercatorLatitude(share(key.y + 1));
    bounds.north = geo::MercatorLatitude(share(key.y));
  }
  return bounds;
}

}  // namespace

bool TileSelection::Contains(std::uint64_t generation_of_key, const geo::TileKey& key, bool is_mercator) const {
  if (generation_of_key != generation || key.level < min_level || key.level > max_level) return false;
  const dem::GeoBounds tile = BoundsOf(key, is_mercator);
  if (tile.south >= box.north || tile.north <= box.south) return false;
  const bool begins_before = tile.west < box.east;
  const bool ends_after = tile.east > box.west;
  return box.west > box.east ? begins_before || ends_after : begins_before && ends_after;
}

}  // namespace terrace::tiler
