// Opens the statistics cache of a command.
#pragma once

#include "config/config.h"
#include "engine/common/dem_types.h"

namespace terrace::cli {

// Uses cache_dir and cache_dir_bytes, and logs both. If the default folder cannot be created, there is no cache; a
// configured folder is tried again with each source.
dem::RasterCache OpenStatisticsCache(const config::Config& config);

}  // namespace terrace::cli
