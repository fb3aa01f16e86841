// The averages of a raster that are stored, so that no tile reads many samples per node.
#pragma once

#include "engine/raster/raster_layout.h"
#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {

// Returns a bit mask of the factors (2 .. kLargestMeasuredFactor / 2, powers of two) whose averages are stored:
// `factor` is stored if `mask & factor`. The statistics contain those from kLargestMeasuredFactor on. A factor is
// stored if no overview has it and ReadAverages would start from more than 512 x 512 samples. So a tile reads at most
// about four samples per node. All factors together take at most 1 1/3 bytes per sample.
unsigned KeptFactors(const RasterLayout& layout);

// Whether the statistics contain averages from kLargestMeasuredFactor on, by the same rule.
bool KeepsCoarse(const RasterLayout& layout);

}  // namespace terrace::dem
