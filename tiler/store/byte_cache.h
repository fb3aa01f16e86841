// A cache of recently used values with a budget in bytes. A scan of many values does not evict the frequently used
// ones.
//
// Thread-safe. The cache is divided into shards with a lock each; the hash of a key selects its shard.
//
// A shard is a segmented LRU (Karedla, Love and Wherry, Computer 27(3), 1994). A new entry is on probation; if it is
// found again, it becomes protected. The least recently used entry on probation is evicted first. Values that are
// requested only once, as by a crawler, thus pass through a fifth of the shard, however many there are. Entries that
// leave the protected part are on probation again. The keys of recently evicted entries are kept for a while as ghosts
// (2Q: Johnson and Shasha, VLDB 1994): an entry that returns meanwhile is protected at once, so that a new working set
// larger than the probation part can enter.
//
// Invariants of a shard, whenever its lock is free:
//   1. Every entry is in one segment once, most recently used first, and in the index once, pointing at its list node.
//      Ghosts have no value; the others have one.
//   2. The charge of a segment is the sum of its entries' charges. Probation and protection together are at most the
//      shard's budget; protection is at most its share of that. Ghosts are not charged: there is at most one for every
//      two entries, and kEntryOverheadBytes includes half of one.
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

#include "tiler/store/cache_stats.h"

namespace terrace::tiler {

// BytesOf(value) returns the size of a value and is found by argument-dependent lookup. Key::generation identifies the
// source that an entry was made from.
template <typename Key, typename Hash, typename Value>
class ByteCache {
 public:
  using ValuePtr = std::shared_ptr<const Value>;

  // Bytes of an entry in addition to its value's, part of its charge: list node, index node and bucket, control block,
  // and half of a ghost's nodes.
  static constexpr std::size_t kEntryOverheadBytes = 640;

  // 0 bytes: off; Find never finds anything. A value larger than a shard is not kept. A new cache has shards of at
  // least 4 MB, or one shard if it has less than kMinShardedBytes. SetCapacity keeps the number of shards.
  explicit ByteCache(std::size_t capacity_bytes) {
    const std::size_t count = capacity_bytes >= kMinShardedBytes ? kShards : 1;
    shards_.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      shards_.push_back(std::make_unique<Shard>());
      shards_.back()->budget = capacity_bytes / count;
    }
  }

  // Null if absent. A value that is found becomes protected, and the most recently used entry of its shard.
  ValuePtr Find(const Key& key) {
    Shard& shard = ShardOf(key);
    const std::lock_guard lock(shard.mutex);
    const auto found = shard.index.find(key);
    if (found == shard.index.end() || !found->second->value) return nullptr;
    shard.Protect(found->second);
    return found->second->value;
  }

  // Replaces an entry with the same key. A value that is larger than a shard's budget is not kept.
  void Insert(const Key& key, ValuePtr value) {
    const std::size_t charge = BytesOf(*value) + kEntryOverheadBytes;
    Shard& shard = ShardOf(key);
    std::list<Entry> gone;  // freed after the lock is released: freeing a large body takes time
    std::vector<ValuePtr> evicted;
    const std::lock_guard lock(shard.mutex);
    if (charge > shard.budget || !shard.Retains(key)) return;
    bool is_known = false;  // a ghost, or protected already
    if (const auto found = shard.index.find(key); found != shard.index.end()) {
      is_known = found->second->segment != &shard.probation;
      shard.Remove(found->second, gone);
    }
    shard.EvictTo(shard.budget - charge, evicted);
    Segment& probation = shard.probation;
    probation.entries.push_front(Entry{key, std::move(value), charge, &probation});
    probation.charged += charge;
    shard.index.emplace(key, probation.entries.begin());
    if (is_known) shard.Protect(probation.entries.begin());
    shard.TrimGhosts(gone);
  }

  // Removes entries of other generations, and refuses such entries from now on.
  void Retain(const std::vector<std::uint64_t>& generations) {
    for (const auto& shard : shards_) {
      std::list<Entry> gone;
      const std::lock_guard lock(shard->mutex);
      shard->retained = generations;
      shard->RemoveIf([&](const Key& key) { return !shard->Retains(key); }, gone);
    }
  }

  // Until the next Retain also accepts entries of these generations.
  void AlsoRetain(const std::vector<std::uint64_t>& generations) {
    for (const auto& shard : shards_) {
      const std::lock_guard lock(shard->mutex);
      if (shard->retained) shard->retained->insert(shard->retained->end(), generations.begin(), generations.end());
    }
  }

  // Removes the entries whose keys `is_chosen` accepts, and returns the number of their values. Calls `is_chosen`
  // without a lock, because it may take long; entries that are inserted meanwhile may stay.
  template <typename Predicate>
  std::size_t EraseIf(const Predicate& is_chosen) {
    std::size_t erased = 0;
    for (const auto& shard : shards_) {
      std::vector<Key> chosen;
      {
        const std::lock_guard lock(shard->mutex);
        chosen.reserve(shard->index.size());
        for (const auto& [key, place] : shard->index) chosen.push_back(key);
      }
      std::erase_if(chosen, [&](const Key& key) { return !is_chosen(key); });
      std::list<Entry> gone;
      const std::lock_guard lock(shard->mutex);
      const std::size_t before = shard->live();
      for (const Key& key : chosen) {
        if (const auto found = shard->index.find(key); found != shard->index.end()) shard->Remove(found->second, gone);
      }
      shard->TrimGhosts(gone);
      erased += before - shard->live();
    }
    return erased;
  }

  // The number of shards stays the same: a cache that was created small keeps its single lock.
  void SetCapacity(std::size_t capacity_bytes) {
    for (const auto& shard : shards_) {
      std::list<Entry> gone;
      std::vector<ValuePtr> evicted;
      const std::lock_guard lock(shard->mutex);
      shard->budget = capacity_bytes / shards_.size();
      shard->Demote();
      shard->EvictTo(shard->budget, evicted);
      shard->TrimGhosts(gone);
    }
  }

  // `hits` and `misses` are 0: the owner counts them, the cache does not know what counts as a request.
  CacheStats stats() const {
    CacheStats stats;
    for (const auto& shard : shards_) {
      const std::lock_guard lock(shard->mutex);
      stats.entries += shard->live();
      stats.bytes += shard->charged();
    }
    return stats;
  }

 private:
  // Below this size a cache is one shard.
  static constexpr std::size_t kMinShardedBytes = std::size_t{64} << 20;
  static constexpr std::size_t kShards = 16;

  struct Segment;
  struct Entry {
    Key key;
    ValuePtr value;
    std::size_t charge = 0;
    Segment* segment = nullptr;  // where it is
  };
  using Place = typename std::list<Entry>::iterator;
  struct Segment {
    std::list<Entry> entries;  // most recently used first
    std::size_t charged = 0;
  };
  struct Shard {
    mutable std::mutex mutex;
    Segment probation, protection, ghosts;
    std::unordered_map<Key, Place, Hash> index;
    std::size_t budget = 0;
    std::optional<std::vector<std::uint64_t>> retained;  // generations; nothing: all

    std::size_t charged() const { return probation.charged + protection.charged; }
    std::size_t live() const { return probation.entries.size() + protection.entries.size(); }
    bool Retains(const Key& key) const {
      return !retained || std::find(retained->begin(), retained->end(), key.generation) != retained->end();
    }
    // Moves an entry to the front of `to` without copying its node.
    void Move(Place entry, Segment& to) {
      Segment& from = *entry->segment;
      from.charged -= entry->charge;
      to.charged += entry->charge;
      to.entries.splice(to.entries.begin(), from.entries, entry);
      entry->segment = &to;
    }
    void Protect(Place entry) {
      Move(entry, protection);
      Demote();
    }
    // At most four fifths are protected. A larger part would keep more values that were found twice, but new values
    // would have less time to be found again.
    void Demote() {
      while (protection.charged > budget / 5 * 4) Move(std::prev(protection.entries.end()), probation);
    }
    void Remove(Place entry, std::list<Entry>& to) {
      Segment& from = *entry->segment;
      from.charged -= entry->charge;
      index.erase(entry->key);
      to.splice(to.end(), from.entries, entry);
    }
    template <typename Predicate>
    void RemoveIf(const Predicate& is_chosen, std::list<Entry>& to) {
      for (Segment* segment : {&probation, &protection, &ghosts}) {
        for (auto entry = segment->entries.begin(); entry != segment->entries.end();) {
          const auto here = entry++;
          if (is_chosen(here->key)) Remove(here, to);
        }
      }
      TrimGhosts(to);
    }
    // Evicts entries until at most `max_bytes` are left. They become ghosts.
    void EvictTo(std::size_t max_bytes, std::vector<ValuePtr>& evicted) {
      while (charged() > max_bytes) {
        Segment& from = probation.entries.empty() ? protection : probation;
        const Place entry = std::prev(from.entries.end());
        Move(entry, ghosts);
        ghosts.charged -= entry->charge;
        entry->charge = 0;
        evicted.push_back(std::move(entry->value));
      }
    }
    void TrimGhosts(std::list<Entry>& gone) {
      while (ghosts.entries.size() > live() / 2) Remove(std::prev(ghosts.entries.end()), gone);
    }
  };

  Shard& ShardOf(const Key& key) {
    // The low bits choose the bucket inside the shard's index, so the shard is chosen by the high ones.
    return *shards_[(Hash{}(key) >> 48) % shards_.size()];
  }

  std::vector<std::unique_ptr<Shard>> shards_;
};

}  // namespace terrace::tiler
