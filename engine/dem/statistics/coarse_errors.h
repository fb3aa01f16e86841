// How far averages of large factors are from the samples, told from smaller averages.
#pragma once

#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/averaging_errors.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Raises the errors of factors above kLargestDirect. The surface between averages of such a factor is compared with the
// one between averages of kLargestDirect samples, whose own errors are known and are added. Both surfaces are bilinear
// between lines, so their difference is largest where lines of either cross: all crossings are looked at.
void AddCoarseErrors(const RasterLayout& layout, const CoarseAverages& coarse, AveragingErrors& errors);

}  // namespace terrace::dem
