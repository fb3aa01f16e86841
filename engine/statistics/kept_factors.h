// The averages of a raster that are stored, so that no tile reads many samples per node.
#pragma once

#include <cstdint>

#include "engine/raster/raster_layout.h"
#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {

// Whether the raster has no overviews and more samples than kMaxSamplesWithoutAverages. Averages by 2 are stored for
// such rasters only.
inline constexpr std::int64_t kMaxSamplesWithoutAverages = std::int64_t{4096} * 4096;
bool IsLargeWithoutOverviews(const RasterLayout& layout);

// Returns a bit mask of the factors (2 .. kLargestMeasuredFactor / 2, powers of two) whose averages are stored:
// `factor` is stored if `mask & factor`. The statistics contain those from kLargestMeasuredFactor on. A factor is
// stored if ReadAverages would otherwise start from more than 512 x 512 samples, and from averages by less than half of
// the factor (less than the factor if IsLargeWithoutOverviews). So a tile reads at most about four samples per node.
// Averages by 4 and more take a third of a byte per sample; averages by 2 take four times as much
// (docs/performance-log.md).
unsigned KeptFactors(const RasterLayout& layout);

// Whether the statistics contain averages from kLargestMeasuredFactor on, by the same rule.
bool KeepsCoarse(const RasterLayout& layout);

}  // namespace terrace::dem
