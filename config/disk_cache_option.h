// The option `disk_cache`: an object with keys of its own. Used inside this room only.
#pragma once

#include "config/config.h"
#include "config/option_codec.h"

namespace terrace::config {

// {"directory": "/var/cache/terrace", "tile_bytes": ..., ...}. As a flag the directory alone.
Codec<Config> DiskCacheOption();

}  // namespace terrace::config
