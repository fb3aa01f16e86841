// The cache tiers below memory: encoded tiles and refinements on disk, which outlive the process.
//
// Read on a worker, before a build; written in the background. A record is found only by the program that wrote it
// (BuildId), only for the generation of the dataset that it was made from, and only if its checksum is right.
// Records that are damaged, lost or outdated are built again.
#pragma once

#include <cstddef>
#include <memory>

#include "config/config.h"
#include "engine/core/result.h"
#include "tiler/store/refinement_cache.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

// Each finds and keeps nothing if the configuration gives it no bytes.
struct DiskCache {
  std::shared_ptr<tiler::TileStore> tiles;
  std::shared_ptr<tiler::RefinementStore> refinements;
};

// `open_files`: of each store (RecordDbOptions). kInvalidArgument: the directory cannot be made or locked, or another
// process uses it. Messages name the remedy.
// `waits_for_room`: Insert waits while its queue is full, so that nothing is lost unless the disk fails; for programs
// that fill the cache ahead of requests.
Result<DiskCache> OpenDiskCache(const config::DiskCacheConfig& config, std::size_t open_files,
                                bool waits_for_room = false);

}  // namespace terrace::server
