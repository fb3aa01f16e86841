#include "tests/proto/grid_tile.h"

#include "proto/mesh/oct_normal.h"
#include "proto/mesh/tile_geometry.h"

namespace terrace::proto {

QuantizedTile GridTile(const geo::TileKey& key, int columns, int rows, float min_height, float max_height,
                       const QuantizedHeight& height) {
  QuantizedTile tile;
  tile.key = key;
  tile.min_height = min_height;
  tile.max_height = max_height;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      tile.u.push_back(static_cast<std::uint16_t>(column * kQuantizedMax / columns));
      tile.v.push_back(static_cast<std::uint16_t>(row * kQuantizedMax / rows));
      tile.h.push_back(height(column, row));
      tile.normals.push_back(
          OctEncode(geo::SurfaceNormal(LongitudeAt(key, tile.u.back()), LatitudeAt(key, tile.v.back()))));
    }
  }
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const auto south_west = static_cast<std::uint32_t>(row * (columns + 1) + column);
      const std::uint32_t north_west = south_west + static_cast<std::uint32_t>(columns) + 1;
      tile.triangles.push_back({south_west, south_west + 1, north_west + 1});
      tile.triangles.push_back({south_west, north_west + 1, north_west});
    }
  }
  return tile;
}

std::string EncodeQuantizedMesh(const QuantizedTile& tile, const TileExtensions& extensions) {
  return EncodeQuantizedMesh(tile, extensions, DecodePositions(tile));
}

QuantizedHeight Rugged() {
  return [](int column, int row) {
    if (row == 0 && column < 2) return static_cast<std::uint16_t>(column * kQuantizedMax);
    const std::uint32_t mixed =
        (static_cast<std::uint32_t>(column) * 73856093u) ^ (static_cast<std::uint32_t>(row) * 19349663u);
    return static_cast<std::uint16_t>((mixed * 2654435761u) >> 17);
  };
}

}  // namespace terrace::proto
