// The checks and properties that every georeferenced file needs after it was opened: height models, images, masks.
#pragma once

#include <gdal_priv.h>

#include <optional>
#include <string>
#include <vector>

#include "engine/common/file_stamp.h"
#include "engine/core/result.h"
#include "engine/crs/georeference.h"
#include "engine/crs/level_plan.h"
#include "engine/gdal/stamped_files.h"

namespace terrace::dem {

struct LocatedRaster {
  GDALDatasetUniquePtr dataset;  // null: it was opened by the caller
  StampedFiles files;
  Georeference georeference;
  SourceSpacing spacing;
  std::vector<std::string> warnings;  // of GDAL, when it opened the dataset
};

// `before`: the stamp of `path` before the dataset was opened. `bands`: in so many bands, from the first on, every
// block must be there. kUnavailable: the file is truncated (CheckComplete). kChanged: it was replaced meanwhile. Other
// errors: those of Georeference::Of and SourceSpacing::Of.
Result<LocatedRaster> LocateRaster(GDALDataset& dataset, const std::string& path,
                                   const std::optional<FileStamp>& before, int bands = 1);

// Opens band 1 of the current file (OpenRaster), and locates it. Errors: those of both.
Result<LocatedRaster> OpenLocatedRaster(const std::string& path);

}  // namespace terrace::dem
