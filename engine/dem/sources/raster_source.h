// One raster file of a dataset: its georeference, layout, height statistics and samples. Independent of levels, floors
// and other rasters. Immutable after Open, thread-safe.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/crs/level_plan.h"
#include "engine/dem/crs/vertical_datum.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/gdal/gdal_handle.h"
#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/sources/prepare.h"
#include "engine/dem/statistics/raster_statistics.h"
#include "engine/dem/statistics/statistics_pages.h"

namespace terrace::dem {

class RasterSource {
 public:
  // Opens and checks a raster, and reads it once for its statistics. Errors name the file, the fault and the remedy.
  // `cache_dir`: the folder of the statistics cache; empty: no cache. `pages`: limits the memory of the statistics of
  // this and other rasters; null: no limit. kCancelled: stopped.
  static Result<std::unique_ptr<RasterSource>> Open(const std::string& path, const SourceOptions& options = {},
                                                    const std::string& cache_dir = {},
                                                    const std::function<void(double)>& progress = {},
                                                    const std::stop_token& stop = {},
                                                    std::shared_ptr<StatisticsPages> pages = nullptr);
  ~RasterSource();

  const RasterInfo& info() const { return info_; }
  const Georeference& georeference() const { return georeference_; }
  // The vertical datum of the samples. They are not converted here.
  const VerticalDatum& vertical() const { return vertical_; }
  const RasterLayout& layout() const { return layout_; }
  const Footprint& footprint() const { return footprint_; }
  const SourceSpacing& spacing() const { return spacing_; }
  const RimVoids& rim_voids() const { return rim_voids_; }
  // Means of the valid samples of the first and the last row.
  const std::array<std::optional<double>, 2>& edge_row_means() const { return edge_row_means_; }

  // The raster's statistics. May read them from the cache file; keep the result for repeated use. Throws
  // std::runtime_error if they can be neither read nor computed again, for example because the raster was removed.
  StatisticsPages::Tables tables() const;
  // The range of a box of pixels (RangeTable::Query). Large boxes need no read of the cache file.
  BlockRange RangeIn(double west, double north, double east, double south) const;
  const StampedFiles& files() const { return handles_.files(); }

  // The averages in the cache file; null: none.
  const CachedAverages* averages() const { return averages_.get(); }

  // How the statistics were made.
  const Preparation& preparation() const { return preparation_; }

  // ReadGrid of this raster, from prepared averages where possible. kChanged: a file was changed, replaced or removed.
  // kUnavailable: a file cannot be read. kCancelled: stopped. Errors name the file.
  Result<std::vector<float>> ReadBlocks(int factor, const GridWindow& window, const std::stop_token& stop) const;

  // kChanged: a file was changed, replaced or removed since it was opened.
  Result<void> CheckUnchanged() const { return handles_.CheckUnchanged(); }

 private:
  void KeepTables(PreparedRaster prepared, const PrepareOptions& prepare, std::shared_ptr<StatisticsPages> pages);
  Result<RasterStatistics> ReadTables() const;

  RasterSource(std::string path, StampedFiles files, Georeference where)
      : handles_(std::move(path), std::move(files)), georeference_(std::move(where)) {}

  mutable HandlePool handles_;  // thread-safe
  const Georeference georeference_;
  VerticalDatum vertical_;
  RasterLayout layout_;
  Footprint footprint_;
  SourceSpacing spacing_;
  std::array<std::optional<double>, 2> edge_row_means_;
  RimVoids rim_voids_;
  StatisticsPages::Tables kept_;  // null: the statistics are paged
  // Set if the statistics are paged.
  struct Paging {
    std::shared_ptr<StatisticsPages> pages;
    RangeTable ranges;  // of coarse blocks
    bool has_coarse_averages;
    std::string cache_file;
    StatisticsShape shape;
    PrepareOptions prepare;
  };
  std::unique_ptr<const Paging> paging_;
  std::shared_ptr<const CachedAverages> averages_;  // null: none
  mutable std::atomic<bool> averages_damaged_{false};
  Preparation preparation_;
  RasterInfo info_;
};

}  // namespace terrace::dem
