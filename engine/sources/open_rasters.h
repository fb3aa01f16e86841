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

// Returns the rasters of `files`, in order. Removes from `files` the files of folders that are not rasters or have no
// heights; `left_out` lists those that look like rasters, with the reasons. Errors as of RasterSource::Open, of the
// first file that fails. `only_cached`: reads no raster, but fails with kCancelled if statistics are missing from the
// cache, after files with other errors were reported to DemOptions::fault.
Result<Rasters> OpenRasters(std::vector<DemFile>& files, const DemOptions& options, std::vector<std::string>& left_out,
                            bool only_cached = false);

}  // namespace terrace::dem
