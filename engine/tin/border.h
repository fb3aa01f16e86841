// One-dimensional simplification of a field's borders: how samples between two neighbouring border vertices are judged.
//
// Everything here is a function of the border's own samples and vertices (BorderOptions in greedy.h states the rule),
// so that two fields with a border in common choose the same vertices on it. Safe to call from many threads at once.
#pragma once

#include <cstdint>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// The side that both ends lie on. Precondition: they are different and share a border.
Side SideOf(const HeightField& field, const Corner& a, const Corner& b);

// The worst valid sample strictly between two neighbouring border vertices, given in any order, by the rule of
// BorderOptions.
Candidate WorstBorderSample(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options);

// Sum of the squared vertical distances of those samples from the chord: no weight, no sagitta.
double SquaredBorderDistances(const HeightField& field, const Corner& a, const Corner& b);

}  // namespace terrace::tin
