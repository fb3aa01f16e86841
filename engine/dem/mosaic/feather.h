// How much a raster grid counts near its edge, where it is blended with what lies below it.
#pragma once

#include <vector>

#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// For each sample of `core` its distance to the nearest void of `wide`, or to the outside of it, as a share of
// `length`, at most 1; voids have 0. Distances are those between centres; `column_step` and `row_step` are the
// distances of neighbours. Exact where `wide` exceeds `core` by length / step samples on every side, or ends where the
// raster ends.
std::vector<float> FeatherWeights(const std::vector<float>& wide_heights, const GridWindow& wide,
                                  const GridWindow& core, double column_step, double row_step, double length);

}  // namespace terrace::dem
