// Small voids, bridged from their rims.
#pragma once

#include <vector>

#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// Along the row, the column and both diagonals of a void the nearest valid samples on both sides make a pair, if at
// most `max_gap` steps lie between the two. The void becomes the mean of the pairs' linear interpolations, weighted by
// one over the squared distance of the pair; without a pair it stays NaN. Filled samples never serve as rims: the
// result is a function of the samples within `max_gap` alone.
//
// `heights` fill the window `wide`; returned are those of the window `core` inside it. Exact if `wide` exceeds `core`
// by max_gap on every side, or ends where the raster ends.
std::vector<float> FillVoids(const std::vector<float>& heights, const GridWindow& wide, const GridWindow& core,
                             int max_gap);

}  // namespace terrace::dem
