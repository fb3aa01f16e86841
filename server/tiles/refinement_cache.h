// Refinements in memory, and on disk below that.
//
// Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "server/tiles/disk_cache.h"
#include "server/tiles/refined_tile.h"

namespace terrace::server {

class RefinementCache {
 public:
  // 0 bytes: none in memory. `disk` may be null.
  explicit RefinementCache(std::size_t memory_bytes, std::shared_ptr<DiskCache> disk = nullptr)
      : memory_(memory_bytes), disk_(std::move(disk)) {}

  // Null when it is not there. Blocks where it has to be read from disk.
  RefinedTilePtr Find(const RefinedTileKey& key);
  RefinedTilePtr FindInMemory(const RefinedTileKey& key) { return memory_.Find(key); }

  void Insert(const RefinedTileKey& key, RefinedTilePtr tile);

  // ByteCache's, of what is in memory.
  void Retain(const std::vector<std::uint64_t>& generations) { memory_.Retain(generations); }
  void SetCapacity(std::size_t memory_bytes) { memory_.SetCapacity(memory_bytes); }
  // Of what is in memory.
  ByteCacheStats stats() const;

 private:
  ByteCache<RefinedTileKey, RefinedTileKeyHash, RefinedTile> memory_;
  const std::shared_ptr<DiskCache> disk_;
  std::atomic<std::uint64_t> hits_{0}, misses_{0};
};

}  // namespace terrace::server
