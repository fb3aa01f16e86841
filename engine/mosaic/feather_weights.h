// The weights of samples near the edges and voids of a raster grid that is blended into those below.
#pragma once

#include <vector>

#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// For each sample of `core`: the distance to the nearest void of `wide`, or to the outside of `wide`, divided by
// `length`, at most 1; 0 for voids. Distances are between sample centres, `column_step` and `row_step` apart. Exact if
// `wide` exceeds `core` by length / step samples on every side, or ends where the raster ends.
std::vector<float> FeatherWeights(const std::vector<float>& wide_heights, const GridWindow& wide,
                                  const GridWindow& core, double column_step, double row_step, double length);

}  // namespace terrace::dem
