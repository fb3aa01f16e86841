// Samples inserted into a finished mesh.
#pragma once

#include <optional>
#include <span>

#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::tin {

// Inserts into one mesh again and again: which triangles are neighbours is found out once.
class SampleInserter {
 public:
  // Joins each sample to the triangles whose circle it lies in, as far as it sees them: what was Delaunay stays so, and
  // any other mesh stays a mesh. Samples that are vertices already are skipped; border samples are refused
  // (TERRACE_CHECK): borders are a function of their own samples. Preconditions: the mesh covers a rectangle once, its
  // corners first; from the second call on, it is what the call before has left.
  void InsertInto(TinMesh& mesh, std::span<const SamplePosition> samples);

 private:
  std::optional<Triangulation> triangulation_;  // from the first call on
};

// The same, once.
TinMesh InsertSamples(TinMesh mesh, std::span<const SamplePosition> samples);

// The Delaunay triangulation of the vertices of a mesh, those on its border too. Preconditions: as above.
TinMesh DelaunayOf(const TinMesh& mesh);

}  // namespace terrace::tin
