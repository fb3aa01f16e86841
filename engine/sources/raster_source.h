// One raster file of a dataset: its georeference, layout, height statistics and samples. Independent of levels, floors
// and other rasters. Immutable after Open, thread-safe.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/averages_budget.h"
#include "engine/common/dem_types.h"
#include "engine/common/lru_block_cache.h"
#include "engine/core/result.h"
#include "engine/crs/footprint.h"
#include "engine/crs/georeference.h"
#include "engine/crs/level_plan.h"
#include "engine/crs/vertical_datum.h"
#include "engine/gdal/handle_pool.h"
#include "engine/gdal/stamped_files.h"
#include "engine/raster/raster_layout.h"
#include "engine/sources/prepare.h"
#include "engine/statistics/cache_files.h"
#include "engine/statistics/raster_statistics.h"

namespace terrace::dem {

using StatisticsPtr = std::shared_ptr<const RasterStatistics>;

// Memory for the statistics of a dataset's rasters. Those that fit `kept` stay in memory with their raster; the others
// are read from the statistics cache on demand, and paged. Thread-safe.
struct StatisticsPages {
  StatisticsPages(std::size_t kept_bytes, std::size_t paged_bytes) : kept(kept_bytes), paged(paged_bytes) {}

  AveragesBudget kept;                                 // bytes
  LruBlockCache<const void*, RasterStatistics> paged;  // by raster
};

class RasterSource {
 public:
  // Opens and checks a raster, and reads it once for its statistics. Errors name the file, the fault and the remedy.
  // Statistics are stored in `cache`, or loaded from it. `pages`: limits the memory of the statistics of this and other
  // rasters; null: no limit. `threads`: that compute statistics. `only_cached`: the raster is not read; if the
  // cache lacks the statistics, Open returns kCancelled after all other checks. kCancelled: stopped as well.
  static Result<std::unique_ptr<RasterSource>> Open(const std::string& path, const SourceOptions& options = {},
                                                    const RasterCache& cache = {},
                                                    const std::function<void(double)>& progress = {},
                                                    const std::stop_token& stop = {},
                                                    std::shared_ptr<StatisticsPages> pages = nullptr,
                                                    unsigned threads = 1, bool only_cached = false);
  ~RasterSource();

  const RasterInfo& info() const { return info_; }
  bool has_heights() const { return info_.valid_samples > 0; }
  // Why a raster without heights cannot be used, with the remedy. Names the file.
  std::string DescribeLackOfHeights() const;
  const Georeference& georeference() const { return georeference_; }
  // The vertical datum of the samples. They are not converted here.
  const VerticalDatum& vertical() const { return vertical_; }
  const RasterLayout& layout() const { return layout_; }
  const Footprint& footprint() const { return footprint_; }
  const SourceSpacing& spacing() const { return spacing_; }
  const RimVoids& rim_voids() const { return rim_voids_; }
  // A hash of the heights in metres. Copies of the file have the same hash.
  const ContentHash& content() const { return content_; }
  // Means of the valid samples of the first and the last row.
  const std::array<std::optional<double>, 2>& edge_row_means() const { return edge_row_means_; }

  // The raster's statistics. May read them from the cache file; keep the result for repeated use. Throws ThrownError if
  // they can be neither read nor computed again, for example because the raster was removed.
  StatisticsPtr statistics() const;
  // The range of a box of pixels (RangeTable::Query). Large boxes need no read of the cache file.
  BlockRange RangeIn(double west, double north, double east, double south) const;
  const StampedFiles& files() const { return handles_.files(); }

  // The averages in the cache file; null: none.
  const CachedAverages* averages() const { return averages_.get(); }
  // Null: none.
  const MemoryAverages* memory_averages() const { return memory_averages_.get(); }
  // Whether the cache file can no longer be read. Reopening the raster restores it, or keeps averages in memory.
  bool has_lost_cache() const { return has_lost_cache_; }

  // How the statistics were made.
  const Preparation& preparation() const { return preparation_; }

  // dem::ReadAverages of this raster, from prepared averages where possible. kChanged: a file was changed, replaced or
  // removed. kUnavailable: a file cannot be read. kCancelled: stopped. Errors name the file.
  Result<std::vector<float>> ReadAverages(int factor, const GridWindow& window, const std::stop_token& stop) const;

  // kChanged: a file was changed, replaced or removed since it was opened.
  Result<void> CheckUnchanged() const { return handles_.CheckUnchanged(); }

 private:
  // Steps of Open, in this order.
  Result<void> FindLayout(GDALDataset& dataset, const std::string& path, const SourceOptions& options);
  Result<PreparedRaster> Prepare(GDALDataset& dataset, const std::string& path, const PrepareOptions& options,
                                 std::string& overviews_unused);
  void FillInfo(GDALDataset& dataset, const std::string& path, const PreparedRaster& prepared);
  void LogOpened(GDALDataset& dataset) const;
  void KeepStatistics(PreparedRaster prepared, const PrepareOptions& prepare, std::shared_ptr<StatisticsPages> pages);
  Result<StatisticsPtr> FindStatistics() const;
  Result<RasterStatistics> ReadStatistics() const;
  void LoseCache(const Error& error) const;

  RasterSource(std::string path, StampedFiles files, Georeference where)
      : handles_(std::move(path), std::move(files)), georeference_(std::move(where)) {}

  mutable HandlePool handles_;  // thread-safe
  const Georeference georeference_;
  VerticalDatum vertical_;
  RasterLayout layout_;
  Footprint footprint_;
  SourceSpacing spacing_;
  ContentHash content_;
  std::array<std::optional<double>, 2> edge_row_means_;
  RimVoids rim_voids_;
  StatisticsPtr kept_;  // null: the statistics are paged
  // Set if the statistics are paged.
  struct Paging {
    std::shared_ptr<StatisticsPages> pages;
    RangeTable ranges;  // of coarse blocks
    bool has_coarse_averages;
    std::string cache_file;
    StatisticsKey key;
    PrepareOptions prepare;
  };
  std::unique_ptr<const Paging> paging_;
  std::shared_ptr<const CachedAverages> averages_;         // null: none
  std::shared_ptr<const MemoryAverages> memory_averages_;  // null: none
  std::shared_ptr<const CacheFileUse> use_;                // of the cache file; null: no cache folder
  mutable std::atomic<bool> has_lost_cache_{false};
  Preparation preparation_;
  RasterInfo info_;
};

}  // namespace terrace::dem
