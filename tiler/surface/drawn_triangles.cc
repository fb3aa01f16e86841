#include "tiler/surface/drawn_triangles.h"

#include <array>
#include <cstdint>
#include <optional>

namespace terrace::tiler {

DrawnTriangles TrianglesOf(const proto::QuantizedTile& tile) {
  const geo::TileKey& key = tile.key;
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const double west = static_cast<double>(key.x) * side - 180, south = static_cast<double>(key.y) * side - 90;
  const double least = tile.min_height, relief = static_cast<double>(tile.max_height) - least;
  DrawnTriangles drawn;
  for (std::size_t i = 0; i < tile.u.size(); ++i) {
    const double u = static_cast<double>(tile.u[i]) / proto::kQuantizedMax,
                 v = static_cast<double>(tile.v[i]) / proto::kQuantizedMax;
    const double height_m = least + static_cast<double>(tile.h[i]) / proto::kQuantizedMax * relief;
    drawn.positions.push_back(geo::ToEcef(west + u * side, south + v * side, height_m));
    drawn.places.push_back({u, v});
  }
  drawn.triangles = tile.triangles;
  return drawn;
}

Result<DrawnTriangles> DrawnByBytes(std::string_view bytes, const geo::TileKey& key) {
  std::optional<proto::QuantizedTile> tile = proto::ReadQuantizedMesh(bytes, key);
  if (!tile) {
    return MakeError(ErrorCode::kUnavailable, "tile {} of the archive is no quantized-mesh; bake it again",
                     geo::ToString(key));
  }
  const auto is_point = [](const std::array<std::uint32_t, 3>& t) { return t[0] == t[1] && t[1] == t[2]; };
  const bool has_holes = std::erase_if(tile->triangles, is_point) > 0;
  std::int64_t covered = 0;  // twice the area
  for (const auto& [a, b, c] : tile->triangles) {
    covered += (std::int64_t{tile->u[b]} - tile->u[a]) * (std::int64_t{tile->v[c]} - tile->v[a]) -
               (std::int64_t{tile->v[b]} - tile->v[a]) * (std::int64_t{tile->u[c]} - tile->u[a]);
  }
  DrawnTriangles drawn = TrianglesOf(*tile);
  drawn.lacks_holes = has_holes || covered != std::int64_t{2} * proto::kQuantizedMax * proto::kQuantizedMax;
  return drawn;
}

}  // namespace terrace::tiler
