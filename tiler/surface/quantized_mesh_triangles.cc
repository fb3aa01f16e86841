#include "tiler/surface/quantized_mesh_triangles.h"

#include <array>
#include <cstdint>
#include <optional>

#include "proto/mesh/tile_geometry.h"

namespace terrace::tiler {

DrawnTriangles TrianglesOf(const proto::QuantizedTile& tile) {
  DrawnTriangles drawn;
  drawn.positions = proto::DecodePositions(tile);
  drawn.places.reserve(tile.u.size());
  for (std::size_t i = 0; i < tile.u.size(); ++i) {
    drawn.places.push_back(
        {static_cast<double>(tile.u[i]) / proto::kQuantizedMax, static_cast<double>(tile.v[i]) / proto::kQuantizedMax});
  }
  drawn.triangles = tile.triangles;
  return drawn;
}

Result<DrawnTriangles> DecodeTriangles(std::string_view bytes, const geo::TileKey& key) {
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
  drawn.holes_are_left_out = has_holes || covered != std::int64_t{2} * proto::kQuantizedMax * proto::kQuantizedMax;
  return drawn;
}

}  // namespace terrace::tiler
