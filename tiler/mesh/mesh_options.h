// How the quantized-mesh and GLB tiles of a dataset are meshed. Meshes of areas do not use these options. Some tiles
// use kDelaunay in any case: those in which an edit cuts a hole; those in which, after rounding, an edge passes between
// neighbouring vertices; and quantized-mesh tiles in which rounding turned a triangle over, which are not compacted
// either.
#pragma once

#include "engine/tin/criterion.h"

namespace terrace::tiler {

struct MeshOptions {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // removes vertices that the error does not need: smaller tiles, longer to build
};

}  // namespace terrace::tiler
