// What was made last, as much as fits into a budget of bytes.
//
// Thread-safe. The cache is cut into shards with a lock each; a key lives in the shard its hash names.
//
// Invariants of a shard, whenever its lock is free:
//   1. Every entry is in the list once, most recently used first, and in the index once, pointing at its list node.
//   2. `charged` is the sum of the entries' charges and at most the shard's budget.
//   3. The generation of every entry's key is one of those that are retained, once Retain was called.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

namespace terrace::server {

struct ByteCacheStats {
  std::size_t entries = 0;
  std::size_t bytes = 0;  // as charged
};

// BytesOf(value), found beside the type of the values, says what a value takes. Key::generation says what an entry is
// made from.
template <typename Key, typename Hash, typename Value>
class ByteCache {
 public:
  using ValuePtr = std::shared_ptr<const Value>;

  // Bytes that an entry costs beyond what it is charged: list node, index node and bucket, control block.
  static constexpr std::size_t kEntryOverheadBytes = 512;

  // 0 bytes: off, nothing is ever found. A value must fit into one shard; the largest are about 2 MB.
  explicit ByteCache(std::size_t capacity_bytes) {
    const std::size_t count = capacity_bytes >= kMinShardedBytes ? kShards : 1;
    shards_.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      shards_.push_back(std::make_unique<Shard>());
      shards_.back()->budget = capacity_bytes / count;
    }
  }

  // Null when it is not there. A value that is found becomes the most recently used one of its shard.
  ValuePtr Find(const Key& key) {
    Shard& shard = ShardOf(key);
    const std::lock_guard lock(shard.mutex);
    const auto found = shard.index.find(key);
    if (found == shard.index.end()) return nullptr;
    shard.entries.splice(shard.entries.begin(), shard.entries, found->second);
    return found->second->value;
  }

  // Replaces an entry with the same key. A value that is larger than a shard's budget is not kept.
  void Insert(const Key& key, ValuePtr value) {
    const std::size_t charge = BytesOf(*value) + kEntryOverheadBytes;
    Shard& shard = ShardOf(key);
    std::list<Entry> evicted;  // freed after the lock: giving back a large body takes time
    const std::lock_guard lock(shard.mutex);
    if (charge > shard.budget || !shard.Retains(key)) return;
    if (const auto found = shard.index.find(key); found != shard.index.end()) {
      shard.Move(found->second, evicted);
    }
    shard.EvictTo(shard.budget - charge, evicted);
    shard.entries.push_front(Entry{key, std::move(value), charge});
    shard.index.emplace(key, shard.entries.begin());
    shard.charged += charge;
  }

  // Entries of other generations leave, and are not taken from now on.
  void Retain(const std::vector<std::uint64_t>& generations) {
    for (const auto& shard : shards_) {
      std::list<Entry> gone;
      const std::lock_guard lock(shard->mutex);
      shard->retained = generations;
      for (auto entry = shard->entries.begin(); entry != shard->entries.end();) {
        const auto here = entry++;
        if (!shard->Retains(here->key)) shard->Move(here, gone);
      }
    }
  }

  // The number of shards stays: a cache that was made small goes on with one lock.
  void SetCapacity(std::size_t capacity_bytes) {
    for (const auto& shard : shards_) {
      std::list<Entry> evicted;
      const std::lock_guard lock(shard->mutex);
      shard->budget = capacity_bytes / shards_.size();
      shard->EvictTo(shard->budget, evicted);
    }
  }

  ByteCacheStats stats() const {
    ByteCacheStats stats;
    for (const auto& shard : shards_) {
      const std::lock_guard lock(shard->mutex);
      stats.entries += shard->entries.size();
      stats.bytes += shard->charged;
    }
    return stats;
  }

 private:
  // Below this size a cache is one shard.
  static constexpr std::size_t kMinShardedBytes = std::size_t{64} << 20;
  static constexpr std::size_t kShards = 16;

  struct Entry {
    Key key;
    ValuePtr value;
    std::size_t charge = 0;
  };
  struct Shard {
    mutable std::mutex mutex;
    std::list<Entry> entries;  // most recently used first
    std::unordered_map<Key, typename std::list<Entry>::iterator, Hash> index;
    std::size_t charged = 0;
    std::size_t budget = 0;
    std::optional<std::vector<std::uint64_t>> retained;  // generations; nothing: all

    bool Retains(const Key& key) const {
      return !retained || std::find(retained->begin(), retained->end(), key.generation) != retained->end();
    }
    void Move(typename std::list<Entry>::iterator entry, std::list<Entry>& to) {
      charged -= entry->charge;
      index.erase(entry->key);
      to.splice(to.end(), entries, entry);
    }
    void EvictTo(std::size_t most, std::list<Entry>& evicted) {
      while (charged > most) Move(std::prev(entries.end()), evicted);
    }
  };

  Shard& ShardOf(const Key& key) {
    // The low bits choose the bucket inside the shard's index, so the shard is chosen by the high ones.
    return *shards_[(Hash{}(key) >> 48) % shards_.size()];
  }

  std::vector<std::unique_ptr<Shard>> shards_;
};

}  // namespace terrace::server
