// The tier of finished tiles that servers share: a Redis, asked after the disk cache and before a build.
//
// Read on a worker, written in the background. A tile is found only by the program that wrote it (BuildId), only for
// the generation of the dataset that it was made from, and only if its checksum, which covers the key, is right. Tiles
// that are cheaper to build than to keep are not stored; docs/decisions/0021-shared-cache.md has the figures.
#pragma once

#include <memory>

#include "config/config.h"
#include "engine/core/result.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

// Checks URL, password and certificates without connecting. kInvalidArgument: the URL is wrong. kUnavailable: a file
// cannot be read. The message names the option, and has no password.
Result<void> CheckSharedCache(const config::SharedCacheConfig& config);

// `readers`: look-ups at a time. Returns at once: a Redis that cannot be reached is no error. Errors: as above.
// Precondition: the configuration has a URL.
Result<std::shared_ptr<tiler::TileStore>> OpenSharedCache(const config::SharedCacheConfig& config, std::size_t readers);

}  // namespace terrace::server
