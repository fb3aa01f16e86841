// Opens the files of a dataset on all cores.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/sources/raster_source.h"

namespace terrace::dem {

using Rasters = std::vector<std::shared_ptr<const RasterSource>>;

// Returns the rasters of `files`, in order. Removes from `files` the files of folders that are not rasters; `left_out`
// lists those that look like rasters, with the reasons. Rasters without heights are returned if they are in folders,
// and another one has heights. Errors as of RasterSource::Open, of the first file that fails; kNotFound: a file has no
// heights. `only_cached`: reads no raster, but fails with kCancelled if statistics are missing from the cache, after
// files with other errors were reported to DemOptions::fault.
Result<Rasters> OpenRasters(std::vector<DemFile>& files, const DemOptions& options, std::vector<std::string>& left_out,
                            bool only_cached = false);

// Warns that these files of folders are left out: each text names a file and says why.
void LogLeftOut(const std::vector<std::string>& texts);

}  // namespace terrace::dem
