#include "archive/pmtiles/tile_id.h"

#include <utility>

namespace terrace::archive {
namespace {

// Tiles above a level.
constexpr std::uint64_t FirstId(int zoom) { return ((std::uint64_t{1} << (2 * zoom)) - 1) / 3; }

// Turns a quadrant so that its curve begins and ends where the next smaller square's does.
void Turn(std::uint64_t side, std::uint64_t right, std::uint64_t lower, std::uint64_t& x, std::uint64_t& y) {
  if (lower != 0) return;
  if (right != 0) {
    x = side - 1 - x;
    y = side - 1 - y;
  }
  std::swap(x, y);
}

}  // namespace

std::uint64_t TileIdOf(const PmtilesKey& key) {
  std::uint64_t x = key.x, y = key.y, position = 0;
  for (std::uint64_t side = (std::uint64_t{1} << key.zoom) >> 1; side > 0; side >>= 1) {
    const std::uint64_t right = (x & side) != 0 ? 1 : 0, lower = (y & side) != 0 ? 1 : 0;
    position += side * side * ((3 * right) ^ lower);
    x &= side - 1;
    y &= side - 1;
    Turn(side, right, lower, x, y);
  }
  return FirstId(key.zoom) + position;
}

std::optional<PmtilesKey> KeyOf(std::uint64_t tile_id) {
  if (tile_id >= FirstId(kMaxZoom + 1)) return std::nullopt;
  PmtilesKey key;
  while (tile_id >= FirstId(key.zoom + 1)) ++key.zoom;
  std::uint64_t rest = tile_id - FirstId(key.zoom);
  for (std::uint64_t side = 1; side < std::uint64_t{1} << key.zoom; side <<= 1) {
    const std::uint64_t right = (rest / 2) & 1, lower = (rest ^ right) & 1;
    Turn(side, right, lower, key.x, key.y);
    key.x += side * right;
    key.y += side * lower;
    rest /= 4;
  }
  return key;
}

}  // namespace terrace::archive
