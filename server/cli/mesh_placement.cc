#include "server/cli/mesh_placement.h"

#include <utility>

namespace terrace::cli {

Result<Placement> PlacementOf(const std::string& path, bool georeferenced, const std::array<double, 6>& geo_transform,
                              const std::string& coordinates) {
  if (coordinates == "crs" && !georeferenced) {
    return MakeError(ErrorCode::kInvalidArgument, "{} has no georeference; use --coordinates pixel", path);
  }
  return georeferenced && coordinates != "pixel" ? Placement(geo_transform) : Placement();
}

std::vector<proto::MeshVertex> VerticesOf(const tin::TinMesh& mesh, const tin::HeightField& field,
                                          const Placement& placement) {
  std::vector<proto::MeshVertex> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const tin::SamplePosition p : mesh.vertices) {
    const double z = field.VertexHeight(p.x, p.y);
    if (!placement) {
      vertices.push_back({static_cast<double>(p.x), static_cast<double>(p.y), z});
      continue;
    }
    const auto& t = *placement;
    const double column = p.x + 0.5, row = p.y + 0.5;  // samples are pixel centres
    vertices.push_back({t[0] + column * t[1] + row * t[2], t[3] + column * t[4] + row * t[5], z});
  }
  return vertices;
}

// The mesh is counter-clockwise in (column, row). A transform that mirrors, as north-up rasters do, turns it over.
std::vector<std::array<std::uint32_t, 3>> TrianglesOf(const tin::TinMesh& mesh, const Placement& placement) {
  std::vector<std::array<std::uint32_t, 3>> triangles = mesh.triangles;
  if (placement && (*placement)[1] * (*placement)[5] - (*placement)[2] * (*placement)[4] < 0) {
    for (auto& triangle : triangles) std::swap(triangle[1], triangle[2]);
  }
  return triangles;
}

}  // namespace terrace::cli
