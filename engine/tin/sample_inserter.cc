#include "engine/tin/sample_inserter.h"

#include <vector>

#include "engine/core/check.h"

namespace terrace::tin {
namespace {

Triangulation TriangulationOf(const TinMesh& mesh) {
  std::vector<Triangulation::Vertex> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const SamplePosition position : mesh.vertices) vertices.push_back({position, 0});
  return {vertices, mesh.triangles};
}

}  // namespace

void SampleInserter::InsertInto(TinMesh& mesh, std::span<const SamplePosition> samples) {
  if (!triangulation_) triangulation_ = TriangulationOf(mesh);
  TERRACE_CHECK(triangulation_->vertex_count() == mesh.vertices.size());
  const SamplePosition last = mesh.vertices[2];
  TriangleId near = 0;
  for (const SamplePosition sample : samples) {
    TERRACE_CHECK(sample.x <= last.x && sample.y <= last.y);
    near = triangulation_->Locate(sample, near);
    if (triangulation_->IsCorner(sample, near)) continue;
    const Star& star = triangulation_->Insert(
        {sample, 0}, near, [](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId) {
          return Cross(u, v) == 0 || (Sees(u, v, w) && IsInsideCircle(v, u, w));
        });
    near = star.triangles[0];
    mesh.vertices.push_back(sample);
    mesh.triangles.resize(triangulation_->triangle_count());
    for (std::size_t i = 0; i < star.count; ++i) {
      mesh.triangles[star.triangles[i]] = triangulation_->triangle(star.triangles[i]);
    }
  }
}

TinMesh InsertSamples(TinMesh mesh, std::span<const SamplePosition> samples) {
  SampleInserter().InsertInto(mesh, samples);
  return mesh;
}

TinMesh DelaunayOf(const TinMesh& mesh) {
  const auto vertex = [&](std::size_t i) { return Triangulation::Vertex{mesh.vertices[i], 0}; };
  Triangulation triangulation({vertex(0), vertex(1), vertex(2), vertex(3)});
  TriangleId near = 0;
  for (std::size_t i = 4; i < mesh.vertices.size(); ++i) {
    near = triangulation.InsertDelaunay(vertex(i), triangulation.Locate(mesh.vertices[i], near)).triangles[0];
  }
  return triangulation.Mesh();
}

}  // namespace terrace::tin
