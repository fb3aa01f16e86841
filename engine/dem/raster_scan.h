// One pass through a whole raster: its range of heights, its voids, and the heights of its outermost rows.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/range_table.h"
#include "engine/dem/sample_grid.h"
#include "engine/dem/void_marks.h"

namespace terrace::dem {

struct RasterScan {
  RangeTable table;               // overviews that are read count too: their resampling may overshoot the samples
  float lowest = 0, highest = 0;  // of the samples
  std::uint64_t valid = 0, voids = 0;
  ZeroEdges zeros;
  std::array<std::optional<double>, 2> edge_row_means;  // of the first and the last row's valid samples
};

// kUnavailable: a part cannot be read. kInvalidArgument: nothing but voids. kCancelled: stopped. Errors do not name the
// file.
Result<RasterScan> ScanRaster(GDALDataset& dataset, const RasterLayout& layout,
                              const std::function<void(double)>& progress, const std::stop_token& stop = {});

}  // namespace terrace::dem
