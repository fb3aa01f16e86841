// The cache tier below memory: encoded tiles and refinements on disk, which outlive the process.
//
// Thread-safe. Read on a worker, before a build; written in the background. A record is found only by the program that
// wrote it (BuildId), only for the generation of the dataset that it was made from, and only if its checksum is
// right. Records that are damaged, lost or outdated are built again.
#pragma once

#include <cstddef>
#include <memory>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/store/disk_store.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

struct DiskCacheStats {
  DiskStoreStats tiles, refinements;
};

class DiskCache {
 public:
  // `open_files`: of each store (RecordDbOptions). kInvalidArgument: the directory cannot be made or locked, or
  // another process uses it. Messages name the remedy.
  static Result<std::shared_ptr<DiskCache>> Open(const config::DiskCacheConfig& config, std::size_t open_files);
  ~DiskCache();

  // Null if the configuration gives them no bytes. Valid as long as this object.
  tiler::TileStore* tiles();
  tiler::RefinementStore* refinements();

  // Returns when everything that was kept before the call is written or dropped.
  void Flush();

  // Drops values that wait to be written, and accepts no more.
  void Abandon();

  DiskCacheStats stats() const;

 private:
  template <typename Key, typename Value>
  class Tier;

  DiskCache(const config::DiskCacheConfig& config, std::size_t open_files, int lock);
  void OpenStores(const config::DiskCacheConfig& config, std::size_t open_files);

  const int lock_;                                                                // a file descriptor
  std::unique_ptr<Tier<tiler::CacheKey, tiler::EncodedTile>> tiles_;              // null: none
  std::unique_ptr<Tier<tiler::RefinedTileKey, tiler::RefinedTile>> refinements_;  // null: none
};

}  // namespace terrace::server
