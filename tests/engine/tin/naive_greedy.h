// Greedy insertion as section 3.2 of the paper has it: every pass looks at every sample of the field again.
//
// The oracle of the optimized algorithm. It shares the triangulation and the rounding of errors with it, and nothing of
// what makes it fast: no spans, no candidates, no queue, no update region.
#pragma once

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// The rule of BorderOptions for a border sample that misses its chord by so much, sagitta included; metres.
double BorderError(double misfit_m, const BorderOptions& options);

// Knows borders and goals, but no curvature and no seeds.
TinMesh NaiveGreedy(const HeightField& field, const std::array<BorderOptions, 4>& borders, const GreedyGoal& goal);

}  // namespace terrace::tin
