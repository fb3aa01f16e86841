// Errors of averages of large factors, computed from smaller averages.
#pragma once

#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/averaging_errors.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Raises the errors of factors above kLargestDirect. Compares the surface between averages of such a factor with the
// surface between averages of kLargestDirect samples, and adds the known errors of the latter. Both surfaces are
// bilinear between grid lines, so the difference is largest where grid lines cross. Evaluates all crossings.
void AddCoarseErrors(const RasterLayout& layout, const CoarseAverages& coarse, AveragingErrors& errors);

}  // namespace terrace::dem
