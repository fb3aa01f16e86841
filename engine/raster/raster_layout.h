// How to read a raster: its layout, its axes, and its averages of aligned blocks of factor x factor samples.
#pragma once

#include <gdal_priv.h>

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/crs/georeference.h"
#include "engine/gdal/sample_rules.h"

namespace terrace::dem {

// The properties of a raster that are needed to read it.
struct RasterLayout {
  // `crs_unit`: as for SampleRules::Of.
  static RasterLayout Of(GDALDataset& dataset, const Georeference& georeference, const std::string& crs_unit);

  int width = 0, height = 0;  // of the file
  int columns = 0;            // columns in use: without the duplicates of a raster around the whole Earth
  bool wraps = false;         // column `columns` is column 0 again
  SampleRules rules;
  std::vector<int> overview_factors;  // powers of two, ascending; overviews of other factors are not used
  double coast_step_m = 100;          // ZeroEdges::CoastStep
};

// One axis of the averaged grid. Positions are in source pixels.
class GridAxis {
 public:
  // `factor`: a power of two.
  GridAxis(int samples, int factor, bool wraps)
      : samples_(samples),
        factor_(factor),
        per_factor_(1.0 / factor),
        count_((samples + factor - 1) / factor),
        wraps_(wraps) {}

  struct Location {
    std::int64_t index = 0;  // of the sample at or before the position; with wrapping it may be -1
    double weight = 0;       // of the next sample; 0 beyond the outermost centres
  };
  Location Locate(double position) const {
    const double place = position * per_factor_ - 0.5;
    const auto index = static_cast<std::int64_t>(place);
    if (!(place >= 0 && index + 2 < count_)) return LocateNearEnd(position);
    // Both blocks are whole.
    const double here = (static_cast<double>(index) + 0.5) * factor_;
    return {index, (position - here) * per_factor_};
  }

  std::int64_t count() const { return count_; }
  bool wraps() const { return wraps_; }
  int samples() const { return samples_; }
  int factor() const { return factor_; }
  // The centre of a block; the last block of an axis may be smaller.
  double Center(std::int64_t index) const;

 private:
  Location LocateNearEnd(double position) const;

  int samples_, factor_;
  double per_factor_;
  std::int64_t count_;
  bool wraps_;
};

// One axis of an overview. Locates the blocks of a grid between overview samples.
//
// For factor f, GDAL reduces W pixels to n samples of W / n pixels each. gdaladdo rounds n = W / f up, cloud-optimized
// GeoTIFFs round it down. If f does not divide W, sample i is not centred on block i of f pixels: the offset grows to
// up to f pixels at the end of the axis.
class OverviewAxis {
 public:
  // `pixels`: of the file; the grid may leave out some at the end (RasterLayout::columns). `is_own`: HasOwnOverviews.
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

struct GridWindow {
  std::int64_t column = 0, row = 0;  // columns may lie outside 0 .. count if the axis wraps
  std::int64_t columns = 0, rows = 0;
};

// Returns the averages of the valid samples of each block in the window, row by row from the north; NaN for blocks
// without valid samples. A value depends only on its block. Starts from the coarsest overview whose factor divides
// `factor`. If the overview's samples do not cover aligned blocks of pixels, blocks are interpolated between them.
Result<std::vector<float>> ReadAverages(GDALDataset& dataset, const RasterLayout& layout, int factor,
                                        const GridWindow& window, const std::stop_token& stop);

// Returns the factor of the overview that ReadAverages starts from; 1: the full raster.
int StartingFactor(const RasterLayout& layout, int factor);

// Returns true if the overviews are the format's own (JPEG, JPEG 2000) and each sample covers a block of exactly
// `factor` pixels. False with an .ovr file, which GDAL prefers.
bool HasOwnOverviews(GDALDataset& dataset);

// Returns the number of pixels that an overview sample covers along an axis of `pixels` pixels and `samples` samples.
double PixelsPerSample(GDALDataset& dataset, int factor, int pixels, int samples);

// Returns the overview of a factor. Its sides are those of the band divided by the factor, each rounded up, as by
// gdaladdo, or down, as in cloud-optimized GeoTIFFs. Null: there is none, or it was removed.
GDALRasterBand* FindOverview(GDALRasterBand& band, int factor);

// Returns the factors of the overviews that ReadAverages can use; all are powers of two.
std::vector<int> OverviewFactors(GDALRasterBand& band);

}  // namespace terrace::dem
