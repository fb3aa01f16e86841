// Greedy insertion as in section 3.2 of the paper: every pass scans all samples of the field again.  The oracle of the
// optimized algorithm. It shares the triangulation and the rounding of errors with it, but no optimization: no spans,
// no candidates, no queue, no update region.
#pragma once

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// The error in metres that BorderOptions gives a border sample with this distance from its chord, including the
// sagitta.
double BorderError(double misfit_m, const BorderOptions& options);

// Supports borders and goals, but no curvature and no seeds.
TinMesh NaiveGreedy(const HeightField& field, const std::array<BorderOptions, 4>& borders, const GreedyGoal& goal);

}  // namespace terrace::tin
