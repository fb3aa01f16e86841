// How the quantized-mesh and GLB tiles of a dataset are meshed. Meshes of areas do not use these options. Two kinds of
// tiles use kDelaunay in any case: those in which an edit cuts a hole, and quantized-mesh tiles in which rounding
// turned a triangle over. The latter are not compacted either.
#pragma once

#include "engine/tin/criterion.h"

namespace terrace::tiler {

struct MeshOptions {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // removes vertices that the error does not need: smaller tiles, longer to build
};

}  // namespace terrace::tiler
