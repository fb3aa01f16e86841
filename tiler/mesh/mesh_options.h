// How the quantized-mesh and GLB tiles of a dataset are meshed. Meshes of areas do not use these options. Exceptions:
// - A tile in which an edit cuts a hole uses kDelaunay.
// - A quantized-mesh tile in which rounding turned a triangle over uses kDelaunay and is not compacted.
// - Rounding moves vertices. On steep ground, the mesh may then be farther from a vertex's sample than the error
//   permits. Usually inserting the neighbouring samples helps. If they are vertices already, but a side of a triangle
//   passes between one of them and this vertex, all vertices are triangulated again by kDelaunay.
#pragma once

#include "engine/tin/criterion.h"

namespace terrace::tiler {

struct MeshOptions {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // removes vertices that the error does not need: smaller tiles, longer to build
};

}  // namespace terrace::tiler
