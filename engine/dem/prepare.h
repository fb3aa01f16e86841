// A raster's survey, from the cache folder where it was made before, else made now and kept there.
#pragma once

#include <gdal_priv.h>

#include <functional>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/dem/file_stamp.h"
#include "engine/dem/raster_survey.h"
#include "engine/dem/survey_record.h"

namespace terrace::dem {

// Rasters with more samples than this and no overviews get averages in the cache folder: the first shallow tile of any
// other reads at most as many.
inline constexpr std::int64_t kMostSamplesWithoutAverages = std::int64_t{4096} * 4096;

// How a survey came about.
struct Preparation {
  bool from_record = false;
  int parts = 0;       // of the raster
  int parts_kept = 0;  // of an interrupted run
  std::int64_t parts_read = 0;
};

struct PreparedRaster {
  RasterSurvey survey;
  std::shared_ptr<const RecordedAverages> averages;  // null: there are none
  Preparation preparation;
};

bool NeedsAverages(const RasterLayout& layout);

// `cache_dir`: empty for none. A folder that cannot be written to costs a warning, never the dataset. Errors name the
// file.
Result<PreparedRaster> PrepareRaster(GDALDataset& dataset, const RasterLayout& layout, const std::string& path,
                                     const StampedFiles& files, const std::string& cache_dir,
                                     const std::function<void(double)>& progress);

// The record of a raster: named after its file and a hash of its whole path.
std::string RecordPath(const std::string& cache_dir, const std::string& path);

}  // namespace terrace::dem
