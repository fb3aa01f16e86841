// How far the surface between a tile's samples is from the samples of its sources:
// docs/decisions/0011-certified-error.md.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/mosaic/raster_grid.h"
#include "engine/geo/lattice.h"

namespace terrace::dem {

// Measures one tile: one Add for each raster grid, in their order.
class SourceErrorBound {
 public:
  // Cells per axis that are judged together where nothing is in the way.
  static constexpr int kGroup = 16;

  // `window` and `heights`: the tile's samples and one more on each side, as they are served. `blends`: raster grids
  // are blended where one gives way to the next.
  SourceErrorBound(const geo::Lattice& lattice, const NodeWindow& window, std::span<const float> heights, bool blends);

  // `trace`: what RasterGrid::Fill noted of this window, for heights above the ellipsoid. Samples may be read where
  // nothing else tells enough. kUnavailable: a raster cannot be read now. kCancelled: stopped.
  Result<void> Add(const RasterGrid& grid, const GridTrace& trace, const std::stop_token& stop);

  // No sample of a further raster grid shows anywhere.
  bool is_covered() const;

  // Metres; infinite only where a source's overviews hide samples of unknown height.
  double bound() const { return bound_ + kRounding; }

 private:
  // Of heights at nodes and of what they are blended from, to 2^-10 m, with room for the arithmetic.
  static constexpr double kRounding = 0x1p-10;

  const geo::Lattice lattice_;
  const NodeWindow window_;
  const std::span<const float> heights_;
  const bool blends_;
  // By cell: no sample of a later raster grid shows in it.
  std::vector<std::uint8_t> covered_;
  double bound_ = 0;

  friend class GridErrorBound;
};

}  // namespace terrace::dem
