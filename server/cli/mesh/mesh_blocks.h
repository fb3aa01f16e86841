// Meshes the blocks of a large raster on several threads.
#pragma once

#include "engine/tin/extended/field_cut.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::cli {

// Returns the joined mesh of all blocks. It does not depend on `threads`, which is at least 1. Shows the number of
// finished blocks. If a thread throws, stops the others and rethrows.
tin::TinMesh MeshBlocks(const tin::HeightField& field, const tin::FieldCut& cut, double max_error_m,
                        const tin::GreedyOptions& options, int threads);

}  // namespace terrace::cli
