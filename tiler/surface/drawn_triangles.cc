#include "tiler/surface/drawn_triangles.h"

#include <utility>

#include "tiler/mesh/mesh_limits.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {

Result<DrawnTriangles> DrawnByQuantizedMesh(const EncoderInput& input, const std::stop_token& stop) {
  Result<MeshedTile> meshed = MeshTile(*input.dataset.source, input.lattice(), input.refined->refinement,
                                       input.dataset.mesh_options, input.error_m, stop);
  if (!meshed) return tl::unexpected(std::move(meshed).error());
  const proto::QuantizedTile& tile = meshed->tile;
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
  drawn.triangles = std::move(meshed->tile.triangles);
  drawn.in_hole = TrianglesInHoles(*input.dataset.source, key, meshed->mesh);
  return drawn;
}

}  // namespace terrace::tiler
