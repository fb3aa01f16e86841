// Fills the disk cache of a server ahead of requests.
#pragma once

#include <vector>

#include "archive/manifest.h"
#include "bake/baker.h"
#include "config/config.h"
#include "server/cli/bake/bake_arguments.h"
#include "server/cli/bake/stop_signals.h"
#include "tiler/tile/coding.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// The manifests, once for each of the codings; formats that are not compressed again have one manifest.
std::vector<archive::Manifest> InCodings(const std::vector<archive::Manifest>& manifests,
                                         const std::vector<tiler::Coding>& codings);

// Builds the tiles of the targets that the cache in the folder `into_cache` does not have, under the keys by which a
// server of this build finds them. `limits`: the server's disk_cache. Returns the exit code: 0 all tiles are there; 1
// some are not, because they cannot be built, the disk fails, or the cache has no room for them; 2 the folder is not a
// cache or is in use; 128 plus the number of the signal that stopped it.
int SeedCache(const BakeArguments& arguments, const config::DiskCacheConfig& limits,
              const tiler::TilePipeline& pipeline, std::vector<bake::Target> targets, const bake::Shard& shard,
              const StopSignals& signals);

}  // namespace terrace::cli
