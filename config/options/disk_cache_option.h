// The option `disk_cache`: an object with keys of its own. Used inside this room only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// {"directory": "/var/cache/terrace", "tile_bytes": ..., ...}. As a flag the directory alone.
Codec<Config> DiskCacheOption();

const std::vector<Option<DiskCacheConfig>>& DiskCacheOptionTable();

}  // namespace terrace::config
