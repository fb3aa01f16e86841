// Fills narrow voids by interpolation across them.
#pragma once

#include <vector>

#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// Along the row, the column and both diagonals through a void, the nearest valid samples on both sides form a pair if
// they are at most `max_gap` steps apart. The void becomes the mean of the linear interpolations between the pairs,
// weighted by the inverse squared distance of each pair. Without a pair it stays NaN. Filled samples are never used for
// other voids, so the result depends on the samples within `max_gap` alone.
//
// `heights`: the window `wide`. Returns the window `core` inside it. Exact if `wide` exceeds `core` by `max_gap` on
// every side, or ends where the raster ends.
std::vector<float> FillVoids(const std::vector<float>& heights, const GridWindow& wide, const GridWindow& core,
                             int max_gap);

}  // namespace terrace::dem
