// Meshing options of a dataset.
#pragma once

#include "engine/tin/criterion.h"

namespace terrace::tiler {

struct MeshOptions {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // removes vertices that the error does not need: smaller tiles, longer to build
};

}  // namespace terrace::tiler
