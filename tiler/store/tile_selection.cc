#include "tiler/store/tile_selection.h"

#include "tiler/tile/tile_bounds.h"

namespace terrace::tiler {

bool TileSelection::Contains(std::uint64_t generation_of_key, const geo::TileKey& key, bool is_mercator) const {
  if (generation_of_key != generation || key.level < min_level || key.level > max_level) return false;
  const dem::GeoBounds tile = TileBounds(key, is_mercator);
  if (tile.south >= box.north || tile.north <= box.south) return false;
  const bool begins_before = tile.west < box.east;
  const bool ends_after = tile.east > box.west;
  return box.west > box.east ? begins_before || ends_after : begins_before && ends_after;
}

}  // namespace terrace::tiler
