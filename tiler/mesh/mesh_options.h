// How the quantized-mesh and GLB tiles of a dataset are meshed. Meshes of areas do not use these options. Exceptions:
// - A tile in which an edit cuts a hole uses kDelaunay.
// - A quantized-mesh tile in which rounding turned a triangle over uses kDelaunay and is not compacted.
// - Rounding may push a vertex over the error while an edge separates it from a vertex at the next sample. Then the
//   vertices are triangulated again by kDelaunay.
#pragma once

#include "engine/tin/criterion.h"

namespace terrace::tiler {

struct MeshOptions {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // removes vertices that the error does not need: smaller tiles, longer to build
};

}  // namespace terrace::tiler
