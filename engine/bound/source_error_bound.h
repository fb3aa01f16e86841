// An upper bound of the distance between the surface through a tile's samples and the samples of its sources
// (docs/decisions/0011-certified-error.md).
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/lattice.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

// The bound of one tile. Call Add for each raster grid, in order of precedence.
class SourceErrorBound {
 public:
  // Cells along a side of a group. Groups without voids, rims or blending are bounded as a whole.
  static constexpr int kGroup = 16;

  // `window` and `heights`: the tile's samples with a halo of one, as served. `blends`: raster grids are blended at
  // their edges. `counts_between`: the heights between samples count as well as the samples. True for the source of
  // an edit `replace`, whose heights are compared at the samples of other sources.
  SourceErrorBound(const geo::Lattice& lattice, const NodeWindow& window, std::span<const float> heights, bool blends,
                   bool counts_between = false);

  // `reading`: of RasterGrid::FillNodes for this window, with heights above the ellipsoid. Reads samples where
  // statistics and averages give no tight bound. kUnavailable: a raster cannot be read now. kCancelled: stopped.
  Result<void> Add(const RasterGrid& grid, const GridReading& reading, const std::stop_token& stop);

  // Whether the raster grids added so far hide all others.
  bool is_covered() const;

  // Metres. Infinite only if an overview of a source is void around samples that have a height.
  double bound() const { return bound_ + kRounding; }

 private:
  // The rounding of heights at nodes and of the heights they are blended from, to 2^-10 m, with a margin for the
  // arithmetic.
  static constexpr double kRounding = 0x1p-10;

  const geo::Lattice lattice_;
  const NodeWindow window_;
  const std::span<const float> heights_;
  const bool blends_, counts_between_;
  // By cell: no sample of a later raster grid shows in it.
  std::vector<std::uint8_t> covered_;
  double bound_ = 0;

  friend class GridErrorBound;
};

}  // namespace terrace::dem
