#include "engine/tin/insert_samples.h"

#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/triangulation.h"

namespace terrace::tin {

TinMesh InsertSamples(const TinMesh& mesh, std::span<const SamplePosition> samples) {
  std::vector<Triangulation::Vertex> vertices;
  vertices.reserve(mesh.vertices.size() + samples.size());
  for (const SamplePosition position : mesh.vertices) vertices.push_back({position, 0});
  const SamplePosition last = mesh.vertices[2];
  Triangulation triangulation(std::move(vertices), mesh.triangles);
  TriangleId near = 0;
  for (const SamplePosition sample : samples) {
    TERRACE_CHECK(sample.x > 0 && sample.x < last.x && sample.y > 0 && sample.y < last.y);
    near = triangulation.Locate(sample, near);
    if (triangulation.IsCorner(sample, near)) continue;
    const Star& star = triangulation.Insert(
        {sample, 0}, near, [](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId) {
          return Cross(u, v) == 0 || (Sees(u, v, w) && IsInsideCircle(v, u, w));
        });
    near = star.triangles[0];
  }
  return triangulation.Mesh();
}

}  // namespace terrace::tin
