// Inserts samples into a finished mesh.
#pragma once

#include <optional>
#include <span>

#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::tin {

// Inserts into one mesh repeatedly. The adjacency of its triangles is computed once.
class SampleInserter {
 public:
  // Replaces the triangles whose circumcircle contains the sample, as far as they are visible from it. A Delaunay mesh
  // stays Delaunay; any other mesh stays a valid mesh. Samples that are vertices already are skipped. Samples on the
  // border divide its edges: meshes that share a border with a neighbour insert none there. Preconditions: the mesh
  // covers a rectangle once, and its first four vertices are the corners; the samples lie in the rectangle; from the
  // second call on, the mesh is the result of the call before.
  void InsertInto(TinMesh& mesh, std::span<const SamplePosition> samples);

 private:
  std::optional<Triangulation> triangulation_;  // from the first call on
};

// A single InsertInto.
TinMesh InsertSamples(TinMesh mesh, std::span<const SamplePosition> samples);

// The Delaunay triangulation of a mesh's vertices, border vertices included. Preconditions: those of InsertInto.
TinMesh DelaunayOf(const TinMesh& mesh);

}  // namespace terrace::tin
