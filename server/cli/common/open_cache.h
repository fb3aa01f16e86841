// Where a command keeps what it learns of sources.
#pragma once

#include "config/config.h"
#include "engine/dem/dem_types.h"

namespace terrace::cli {

// As cache_dir and cache_dir_bytes say. A line of the log tells the place and the bound. A default place that cannot be
// made is none; one that was asked for is tried with each source.
dem::RasterCache OpenCache(const config::Config& config);

}  // namespace terrace::cli
