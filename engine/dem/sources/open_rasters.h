// The files of a dataset, opened on all cores.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/sources/raster_source.h"

namespace terrace::dem {

using Rasters = std::vector<std::shared_ptr<const RasterSource>>;

// The rasters of `files`, in their order. What stands in a folder and is no raster, or has no height, leaves `files`;
// `left_out` says which of these look like rasters, and why they are none. Errors are those of RasterSource::Open; of
// several the one of the first file.
Result<Rasters> OpenRasters(std::vector<DemFile>& files, const DemOptions& options, std::vector<std::string>& left_out);

}  // namespace terrace::dem
