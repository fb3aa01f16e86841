#include "tiler/mesh/inner_vertices.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/sample_inserter.h"
#include "proto/mesh/tile_normals.h"

namespace terrace::tiler {

tin::TinMesh WithInnerVertices(const proto::TileSamples& samples, tin::TinMesh mesh) {
  const int cells = samples.cells();
  const auto on_edges = static_cast<std::size_t>(std::ranges::count_if(
      mesh.vertices, [&](tin::SamplePosition p) { return p.x == 0 || p.y == 0 || p.x == cells || p.y == cells; }));
  if (2 * on_edges < mesh.vertices.size()) return mesh;
  std::vector<geo::Vec3> positions;
  for (const tin::SamplePosition p : mesh.vertices) {
    positions.push_back(
        geo::ToEcef(samples.Longitude(p.x), samples.Latitude(p.y), static_cast<double>(samples.At(p.x, p.y))));
  }
  const std::size_t misfits = proto::CountMisfits(mesh, positions, proto::VertexNormals(samples, mesh, positions));
  if (2 * misfits < mesh.vertices.size()) return mesh;

  const int side = std::min(static_cast<int>(std::sqrt(static_cast<double>(on_edges))) + 1, cells - 1);
  std::vector<tin::SamplePosition> inside;
  for (int j = 1; j <= side; ++j) {
    for (int i = 1; i <= side; ++i) {
      inside.push_back(
          {static_cast<std::uint16_t>(i * cells / (side + 1)), static_cast<std::uint16_t>(j * cells / (side + 1))});
    }
  }
  return tin::InsertSamples(std::move(mesh), inside);
}

}  // namespace terrace::tiler
