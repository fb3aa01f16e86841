// The blocks of a large raster, meshed on several threads.
#pragma once

#include "engine/tin/extended/field_cut.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::cli {

// The joined mesh of the cut's blocks: the same whatever `threads`, 1 at least, is. Shows how many blocks are done.
// An exception of any thread stops the others and is thrown here.
tin::TinMesh MeshBlocks(const tin::HeightField& field, const tin::FieldCut& cut, double max_error_m,
                        const tin::GreedyOptions& options, int threads);

}  // namespace terrace::cli
