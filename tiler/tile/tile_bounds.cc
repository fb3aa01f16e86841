#include "tiler/tile/tile_bounds.h"

#include "engine/geo/mercator_grid.h"

namespace terrace::tiler {

bool IsInScheme(const geo::TileKey& key, bool is_mercator) {
  return geo::IsValid(key) && (!is_mercator || key.x < geo::TileRows(key.level));
}

dem::GeoBounds TileBounds(const geo::TileKey& key, bool is_mercator) {
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

}  // namespace terrace::tiler
