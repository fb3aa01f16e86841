// A raster's statistics, from the cache folder where it was made before, else made now and kept there.
#pragma once

#include <gdal_priv.h>

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/dem/statistics/raster_statistics.h"
#include "engine/dem/statistics/statistics_cache.h"

namespace terrace::dem {

struct PrepareOptions {
  std::string cache_dir;  // empty: none
  bool find_voids = true;
  std::function<void(double)> progress = {};  // of each pass, 0..1
  std::stop_token stop = {};
};

// How the statistics were made.
struct Preparation {
  bool from_record = false;
  int parts = 0;        // of the raster
  int chunks_kept = 0;  // of an interrupted run
  std::int64_t chunks_read = 0;
};

struct PreparedRaster {
  DetectedNodata detected;  // undeclared voids; the statistics is one without them
  RasterStatistics statistics;
  std::shared_ptr<const CachedAverages> averages;  // null: there are none
  std::string record;                              // where the statistics is kept; empty: nowhere
  StatisticsShape shape;                           // the record's
  Preparation preparation;
};

// `layout`: as the raster and its owner state it. A folder that cannot be written to costs a warning, never the
// dataset. Errors name the file. kCancelled: stopped; what was done by then is kept.
Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const PrepareOptions& options);

// The record of a raster: named after its file and a hash of its whole path, of what its owner says of its voids, as
// two datasets may have one file and think differently of it, and of whether overviews are used: where they turn out to
// be made of voids it takes two records, one to know that and one without them, and both are found again.
std::string StatisticsPath(const std::string& cache_dir, const std::string& path,
                           const std::vector<double>& extra_nodata = {}, bool find_voids = true,
                           bool has_overviews = false);

}  // namespace terrace::dem
