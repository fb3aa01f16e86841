// Which averages of a raster are kept, so that no tile reads many samples for a node.
#pragma once

#include <cstdint>

#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/raster_chunk.h"

namespace terrace::dem {

// Large rasters without overviews keep averages by 2, too, so that no tile reads more samples than one of smaller ones.
inline constexpr std::int64_t kMaxSamplesWithoutAverages = std::int64_t{4096} * 4096;
bool NeedsAverages(const RasterLayout& layout);

// The sum of the factors 2 .. kLargestDirect / 2 whose averages are kept beside the statistics, which have those from
// kLargestDirect on. A factor is kept where ReadGrid would start from more than 512 x 512 samples, and from more than
// about four for each average. So a tile reads at most about four samples a node. Without overviews averages by 4 and
// more are kept: a third of a byte a sample. Those by 2 would take four times as much and save a tenth of the tiles
// that read them (docs/performance.md).
unsigned KeptFactors(const RasterLayout& layout);

// Whether the statistics keep averages from kLargestDirect on, by the same rule.
bool KeepsCoarse(const RasterLayout& layout);

}  // namespace terrace::dem
