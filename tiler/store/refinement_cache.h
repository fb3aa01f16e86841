// Refinements in memory, with an optional slower store below.
//
// Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include "tiler/store/byte_cache.h"
#include "tiler/store/refined_tile.h"
#include "tiler/store/tile_store.h"

namespace terrace::tiler {

using RefinementStore = Store<RefinedTileKey, RefinedTile>;

class RefinementCache {
 public:
  // `memory_bytes` 0: keeps none in memory. `below` may be null.
  explicit RefinementCache(std::size_t memory_bytes, std::shared_ptr<RefinementStore> below = nullptr)
      : memory_(memory_bytes), below_(std::move(below)) {}

  // Null if absent. Blocks if the store below blocks.
  RefinedTilePtr Find(const RefinedTileKey& key);
  RefinedTilePtr FindInMemory(const RefinedTileKey& key) { return memory_.Find(key); }

  void Insert(const RefinedTileKey& key, RefinedTilePtr tile);

  // Erases the refinements of these tiles. Blocks if the store below blocks. Errors: those of the store below.
  struct Erased {
    std::size_t memory = 0, below = 0;
  };
  Result<Erased> Erase(const TileSelection& selection, const std::stop_token& stop = {});

  // As those of ByteCache, for the memory tier.
  void Retain(const std::vector<std::uint64_t>& generations) { memory_.Retain(generations); }
  void AlsoRetain(const std::vector<std::uint64_t>& generations) { memory_.AlsoRetain(generations); }
  void SetCapacity(std::size_t memory_bytes) { memory_.SetCapacity(memory_bytes); }
  // Of the memory tier.
  CacheStats stats() const;
  StoreBase* below() const { return below_.get(); }  // may be null

 private:
  ByteCache<RefinedTileKey, RefinedTileKeyHash, RefinedTile> memory_;
  const std::shared_ptr<RefinementStore> below_;
  std::atomic<std::uint64_t> hits_{0}, misses_{0};
};

}  // namespace terrace::tiler
