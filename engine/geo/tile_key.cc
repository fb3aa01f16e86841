#include "engine/geo/tile_key.h"

#include <fmt/format.h>

namespace terrace::geo {

TileKey Neighbour(const TileKey& key, int dx, int dy) {
  const std::int64_t columns = TileColumns(key.level);
  return {key.level, ((key.x + dx) % columns + columns) % columns, key.y + dy};
}

std::string ToString(const TileKey& key) { return fmt::format("{}/{}/{}", key.level, key.x, key.y); }

}  // namespace terrace::geo
