// The option `disk_cache`: an object with its own keys. For this module only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// {"directory": "/var/cache/terrace", "tile_bytes": ..., ...}. As a flag: only the directory.
Codec<Config> DiskCacheOption();

const std::vector<Option<DiskCacheConfig>>& DiskCacheOptionTable();

}  // namespace terrace::config
