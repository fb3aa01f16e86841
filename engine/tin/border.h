// One-dimensional simplification of a field's borders: the error of samples between two neighbouring border vertices.
//
// Everything here depends on the samples and vertices of one border alone (BorderOptions in greedy.h states the rule),
// so that two fields that share a border choose the same vertices on it. Safe to call from many threads at once.
#pragma once

#include <cstdint>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// The side that both corners lie on. Precondition: they are different and on one border.
Side SideOf(const HeightField& field, const Corner& a, const Corner& b);

// The worst valid sample strictly between two neighbouring border vertices, given in any order, by the rule of
// BorderOptions.
Candidate WorstBorderSample(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options);

// Sum of the squared vertical distances of the same samples from the chord, without weight and sagitta.
double SquaredBorderDistances(const HeightField& field, const Corner& a, const Corner& b);

}  // namespace terrace::tin
