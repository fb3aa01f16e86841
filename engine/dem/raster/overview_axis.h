// The pixels of a raster that each overview sample covers.
//
// For factor f, GDAL reduces W pixels to n samples of W / n pixels each. gdaladdo rounds n = W / f up, cloud-optimized
// GeoTIFFs round it down. If f does not divide W, sample i is not centred on block i of f pixels: the offset grows to
// up to f pixels at the end of the axis.
#pragma once

#include <gdal_priv.h>

#include <cstdint>

#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// Returns true if the overviews are the format's own (JPEG, JPEG 2000) and each sample covers a block of exactly
// `factor` pixels. False with an .ovr file, which GDAL prefers.
bool HasOwnOverviews(GDALDataset& dataset);

// Returns the number of pixels that an overview sample covers along an axis of `pixels` pixels and `samples` samples.
double PixelsPerSample(GDALDataset& dataset, int factor, int pixels, int samples);

// One axis of an overview. Locates the blocks of a grid between overview samples.
class OverviewAxis {
 public:
  // `pixels`: of the file; the grid may leave out some at the end (RasterLayout::columns).
  OverviewAxis(const GridAxis& blocks, int pixels, int samples, bool is_own)
      : blocks_(blocks), pixels_(pixels), samples_(samples), is_own_(is_own) {}

  // Returns the location of the block's centre, clamped to the outermost samples' centres. If the axis wraps, the
  // sample after the last one is the first.
  GridAxis::Location Around(std::int64_t block) const;

  std::int64_t samples() const { return samples_; }

 private:
  GridAxis blocks_;
  std::int64_t pixels_, samples_;
  bool is_own_;
};

}  // namespace terrace::dem
