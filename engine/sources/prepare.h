// The statistics of a raster: loaded from the statistics cache, or read from the raster and stored there.
#pragma once

#include <gdal_priv.h>

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/gdal/stamped_files.h"
#include "engine/statistics/cache_files.h"
#include "engine/statistics/memory_averages.h"
#include "engine/statistics/raster_statistics.h"
#include "engine/statistics/statistics_cache.h"

namespace terrace::dem {

struct PrepareOptions {
  RasterCache cache;
  bool find_voids = true;
  std::function<void(double)> progress = {};  // share done of each pass, 0 .. 1
  std::stop_token stop = {};
  unsigned threads = 1;      // that compute statistics
  bool only_cached = false;  // fails with kCancelled instead of reading the raster
};

// How the statistics were made.
struct Preparation {
  bool from_cache = false;
  int chunks = 0;       // of the raster
  int chunks_kept = 0;  // from an interrupted run
  std::int64_t chunks_read = 0;
};

struct PreparedRaster {
  DetectedNodata detected;  // undeclared nodata; the statistics exclude it
  RasterStatistics statistics;
  std::shared_ptr<const CachedAverages> averages;         // null: none
  std::shared_ptr<const MemoryAverages> memory_averages;  // if the file is not stored; null: none
  std::string cache_file;                                 // empty: not stored
  std::shared_ptr<const CacheFileUse> use;                // of the cache file, stored or not; null: no cache folder
  StatisticsKey key;                                      // of the cache file
  Preparation preparation;
};

// `layout`: as the file and the configuration state it. If the cache folder cannot store the statistics, or there is
// none, averages are kept in memory as far as they fit. Errors name the file. kCancelled: stopped; finished chunks stay
// in the cache.
Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const PrepareOptions& options);

// The cache file of a raster. Its name contains the raster's name and a hash of its full path, of what two datasets may
// configure differently for one file (nodata values, detection of voids, the unit of a vertical datum), and of the use
// of overviews. A raster whose overviews turn out to contain voids has two cache files: one that says so, and one made
// without the overviews.
std::string StatisticsPath(const std::string& cache_dir, const std::string& path,
                           const std::vector<double>& extra_nodata = {}, bool find_voids = true,
                           bool has_overviews = false, double metres_per_unit = 1);

}  // namespace terrace::dem
