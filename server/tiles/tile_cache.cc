#include "server/tiles/tile_cache.h"

#include <utility>

namespace terrace::server {
namespace {

// A tile must fit into one shard; the largest tiles are about 2 MB. Below this size a cache is one shard.
constexpr std::size_t kMinShardedBytes = std::size_t{64} << 20;
constexpr std::size_t kShards = 16;

}  // namespace

TileCache::TileCache(std::size_t capacity_bytes) {
  const std::size_t count = capacity_bytes >= kMinShardedBytes ? kShards : 1;
  shard_budget_ = capacity_bytes / count;
  shards_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) shards_.push_back(std::make_unique<Shard>());
}

TileCache::Shard& TileCache::ShardOf(const CacheKey& key) {
  // The low bits choose the bucket inside the shard's index, so the shard is chosen by the high ones.
  return *shards_[(CacheKeyHash{}(key) >> 48) % shards_.size()];
}

TilePtr TileCache::Find(const CacheKey& key) {
  Shard& shard = ShardOf(key);
  const std::lock_guard lock(shard.mutex);
  const auto found = shard.index.find(key);
  if (found == shard.index.end()) return nullptr;
  shard.entries.splice(shard.entries.begin(), shard.entries, found->second);
  return found->second->tile;
}

void TileCache::Insert(const CacheKey& key, TilePtr tile) {
  const std::size_t charge = tile->bytes.size() + kEntryOverheadBytes;
  if (charge > shard_budget_) return;
  Shard& shard = ShardOf(key);
  std::list<Entry> evicted;  // freed after the lock: giving back a large body takes time
  const std::lock_guard lock(shard.mutex);
  if (const auto found = shard.index.find(key); found != shard.index.end()) {
    shard.charged -= found->second->charge;
    evicted.splice(evicted.end(), shard.entries, found->second);
    shard.index.erase(found);
  }
  while (shard.charged + charge > shard_budget_) {
    shard.charged -= shard.entries.back().charge;
    shard.index.erase(shard.entries.back().key);
    evicted.splice(evicted.end(), shard.entries, std::prev(shard.entries.end()));
  }
  shard.entries.push_front(Entry{key, std::move(tile), charge});
  shard.index.emplace(key, shard.entries.begin());
  shard.charged += charge;
}

TileCache::Stats TileCache::stats() const {
  Stats stats;
  for (const auto& shard : shards_) {
    const std::lock_guard lock(shard->mutex);
    stats.entries += shard->entries.size();
    stats.bytes += shard->charged;
  }
  return stats;
}

}  // namespace terrace::server
