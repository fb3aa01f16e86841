// Which pixels of a raster its overviews stand for.
//
// GDAL makes n samples of W pixels for factor f, and each stands for W / n of them: n is W / f, rounded up by gdaladdo
// and down in cloud-optimized GeoTIFFs, so where f does not divide W that is less or more than f. Samples drift away
// from the blocks of f pixels of their number, by up to f pixels at the far end of the axis.
#pragma once

#include <gdal_priv.h>

#include <cstdint>

#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// True where overviews are the format's own, such as those of wavelets, and each sample stands for a whole block.
bool HasOwnOverviews(GDALDataset& dataset);

// Pixels that a sample of an overview stands for, along an axis of the raster.
double PixelsPerSample(GDALDataset& dataset, int factor, int pixels, int samples);

// One axis of an overview: where the blocks of a grid lie between its samples.
class OverviewAxis {
 public:
  // `pixels` of the file, of which the grid may leave out some at the end (RasterLayout::columns).
  OverviewAxis(const GridAxis& blocks, int pixels, int samples, bool is_own)
      : blocks_(blocks), pixels_(pixels), samples_(samples), is_own_(is_own) {}

  // Of the block's centre; beyond the outermost samples' centres these count. The sample behind the last one is the
  // first, a turn on.
  GridAxis::Location Around(std::int64_t block) const;

  std::int64_t samples() const { return samples_; }

 private:
  GridAxis blocks_;
  std::int64_t pixels_, samples_;
  bool is_own_;
};

}  // namespace terrace::dem
