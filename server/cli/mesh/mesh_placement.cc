#include "server/cli/mesh/mesh_placement.h"

#include <utility>

namespace terrace::cli {

Result<Placement> PlacementOf(const std::string& path, bool georeferenced, const std::array<double, 6>& geo_transform,
                              const std::string& coordinates) {
  if (coordinates == "crs" && !georeferenced) {
    return MakeError(ErrorCode::kInvalidArgument, "{} has no georeference; use --coordinates pixel", path);
  }
  return georeferenced && coordinates != "pixel" ? Placement{0.5, geo_transform} : Placement{};
}

std::vector<proto::MeshVertex> VerticesOf(const tin::TinMesh& mesh, const tin::HeightField& field,
                                          const Placement& placement) {
  std::vector<proto::MeshVertex> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const tin::SamplePosition p : mesh.vertices) {
    vertices.push_back({p.x + placement.first, p.y + placement.first, field.VertexHeight(p.x, p.y)});
  }
  return vertices;
}

// The mesh is counter-clockwise in (column, row). A mirroring transform, as of north-up rasters, reverses the
// orientation.
std::vector<std::array<std::uint32_t, 3>> TrianglesOf(const tin::TinMesh& mesh, const Placement& placement) {
  std::vector<std::array<std::uint32_t, 3>> triangles = mesh.triangles;
  const proto::GridPlacement& t = placement.grid;
  if (t[1] * t[5] - t[2] * t[4] < 0) {
    for (auto& triangle : triangles) std::swap(triangle[1], triangle[2]);
  }
  return triangles;
}

}  // namespace terrace::cli
