// The averages of a raster that are stored, so that no tile reads many samples per node.
#pragma once

#include <cstdint>

#include "engine/raster/sample_grid.h"
#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {

// Averages by 2 are also stored for large rasters without overviews, so that their tiles read no more samples than
// those of smaller rasters.
inline constexpr std::int64_t kMaxSamplesWithoutAverages = std::int64_t{4096} * 4096;
bool NeedsAverages(const RasterLayout& layout);

// Returns the sum of the factors 2 .. kLargestDirect / 2 whose averages are stored; the statistics contain those from
// kLargestDirect on. A factor is stored if ReadGrid would start from more than 512 x 512 samples, and from more than
// about four per average. So a tile reads at most about four samples per node. Without overviews, averages by 4 and
// more are stored, a third of a byte per sample. Averages by 2 would take four times as much and save a tenth of the
// tiles that read them (docs/performance.md).
unsigned KeptFactors(const RasterLayout& layout);

// Whether the statistics contain averages from kLargestDirect on, by the same rule.
bool KeepsCoarse(const RasterLayout& layout);

}  // namespace terrace::dem
