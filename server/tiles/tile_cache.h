// The tiles that were built last, as many as fit into a budget of bytes.
//
// Thread-safe. The cache is cut into shards with a lock each; a key lives in the shard its hash names.
//
// Invariants of a shard, whenever its lock is free:
//   1. Every entry is in the list once, most recently used first, and in the index once, pointing at its list node.
//   2. `charged` is the sum of the entries' charges and at most the shard's budget.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "server/tiles/encoded_tile.h"
#include "server/tiles/tile_request.h"

namespace terrace::server {

// A request, and the generation of the dataset it is about: a replaced source never meets tiles of the old one.
struct CacheKey {
  TileRequest request;
  std::uint64_t generation = 0;

  friend bool operator==(const CacheKey&, const CacheKey&) = default;
};

struct CacheKeyHash {
  std::size_t operator()(const CacheKey& key) const noexcept {
    return TileRequestHash{}(key.request) ^ static_cast<std::size_t>(key.generation);
  }
};

class TileCache {
 public:
  // Bytes that an entry costs beyond its body: list node, index node and bucket, control block, etag.
  static constexpr std::size_t kEntryOverheadBytes = 512;

  // 0 bytes: off, nothing is ever found.
  explicit TileCache(std::size_t capacity_bytes);

  // Null when it is not there. A tile that is found becomes the most recently used one of its shard.
  TilePtr Find(const CacheKey& key);

  // Replaces an entry with the same key. A tile that is larger than a shard's budget is not kept.
  void Insert(const CacheKey& key, TilePtr tile);

  struct Stats {
    std::size_t entries = 0;
    std::size_t bytes = 0;  // as charged
  };
  Stats stats() const;

 private:
  struct Entry {
    CacheKey key;
    TilePtr tile;
    std::size_t charge = 0;
  };
  struct Shard {
    mutable std::mutex mutex;
    std::list<Entry> entries;  // most recently used first
    std::unordered_map<CacheKey, std::list<Entry>::iterator, CacheKeyHash> index;
    std::size_t charged = 0;
  };

  Shard& ShardOf(const CacheKey& key);

  std::size_t shard_budget_;
  std::vector<std::unique_ptr<Shard>> shards_;
};

}  // namespace terrace::server
