// Sums of squared distances between samples and a triangle, for the root-mean-square goal.
#pragma once

#include <array>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// Sum of the squared vertical distances, in square metres, of the samples that ForEachInnerSpan visits. Samples on an
// edge count one half in each of the two triangles. Voids are skipped. Safe to call from many threads at once.
double SquaredDistances(const HeightField& field, const std::array<Corner, 3>& corners);

}  // namespace terrace::tin
