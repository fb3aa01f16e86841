// The tier below memory: encoded tiles and refinements on disk, where they outlive the process.
//
// Thread-safe. Looked into on a worker, before a build; written off the request's path. A record is found only by the
// program that wrote it (EncoderVersion) and for the dataset's generation that it was made from, and only if its
// checksum holds: what the disk damaged, lost or kept for too long is built again.
#pragma once

#include <filesystem>
#include <memory>

#include "engine/core/result.h"
#include "server/store/disk_store.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

struct DiskCacheOptions {
  std::filesystem::path directory;   // made if it is missing
  std::size_t tile_bytes = 0;        // of files with encoded tiles, RecordDb::kMinCapacity at least; 0: none
  std::size_t refinement_bytes = 0;  // of files with refinements, likewise
  std::size_t open_files = RecordDbOptions().open_files;  // of each store
  rocksdb::Env* env = nullptr;                            // RecordDbOptions::env
  std::chrono::milliseconds retry_after = DiskStoreOptions().retry_after;
};

struct DiskCacheStats {
  DiskStoreStats tiles, refinements;
};

class DiskCache {
 public:
  // kInvalidArgument: the directory cannot be made or locked, or another process uses it. Messages name the remedy.
  static Result<std::shared_ptr<DiskCache>> Open(const DiskCacheOptions& options);
  ~DiskCache();

  // Null where the options give them no bytes. They live as long as this.
  tiler::TileStore* tiles();
  tiler::RefinementStore* refinements();

  // Returns when everything that was kept before the call is written or dropped.
  void Flush();

  // Drops what waits to be written, and keeps nothing more.
  void Abandon();

  DiskCacheStats stats() const;

 private:
  template <typename Key, typename Value>
  class Tier;

  DiskCache(const DiskCacheOptions& options, int lock);
  void OpenStores(const DiskCacheOptions& options);

  const int lock_;                                                                // a file descriptor
  std::unique_ptr<Tier<tiler::CacheKey, tiler::EncodedTile>> tiles_;              // null: none
  std::unique_ptr<Tier<tiler::RefinedTileKey, tiler::RefinedTile>> refinements_;  // null: none
};

}  // namespace terrace::server
