// How far the samples of one triangle are from it in the mean: what the root-mean-square goal adds up.
#pragma once

#include <array>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// Sum of the squared vertical distances, in square metres, of the samples that ForEachInnerSpan visits. Those on an
// edge count one half: their other half is in the triangle across. Voids are skipped. Safe to call from many threads at
// once.
double SquaredDistances(const HeightField& field, const std::array<Corner, 3>& corners);

}  // namespace terrace::tin
