// What is used most lately, as much as fits into a budget of bytes; a scan does not drive out what is asked for often.
//
// Thread-safe. The cache is cut into shards with a lock each; a key lives in the shard its hash names.
//
// A shard is a segmented LRU (Karedla, Love and Wherry, Computer 27(3), 1994): what is inserted is on probation, what
// is found there becomes protected, and the least recently used on probation leaves first. So what is asked for once,
// as a crawler asks, passes through a fifth of the shard, however much of it there is. What falls out of the protected
// part is on probation again. Of what left lately the keys stay for a while, as ghosts (2Q: Johnson and Shasha, VLDB
// 1994): what comes back meanwhile is protected at once, so that a new hot set gets in that is larger than the
// probation.
//
// Invariants of a shard, whenever its lock is free:
//   1. Every entry is in one segment once, most recently used first, and in the index once, pointing at its list node.
//      Ghosts have no value; the others have one.
//   2. The charge of a segment is the sum of its entries' charges. Probation and protection together are at most the
//      shard's budget; protection is at most its share of that. Ghosts are not charged: there is at most one for every
//      two entries, whose overhead has room for it.
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

namespace terrace::tiler {

struct ByteCacheStats {
  std::size_t entries = 0;
  std::size_t bytes = 0;               // as charged
  std::uint64_t hits = 0, misses = 0;  // where the owner counts them; the cache does not know what counts as a request
};

// BytesOf(value), found beside the type of the values, says what a value takes. Key::generation says what an entry is
// made from.
template <typename Key, typename Hash, typename Value>
class ByteCache {
 public:
  using ValuePtr = std::shared_ptr<const Value>;

  // Bytes that an entry costs beyond what it is charged: list node, index node and bucket, control block, and half of a
  // ghost's nodes.
  static constexpr std::size_t kEntryOverheadBytes = 640;

  // 0 bytes: off, nothing is ever found. A value must fit into one shard; the largest are about 2 MB.
  explicit ByteCache(std::size_t capacity_bytes) {
    const std::size_t count = capacity_bytes >= kMinShardedBytes ? kShards : 1;
    shards_.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      shards_.push_back(std::make_unique<Shard>());
      shards_.back()->budget = capacity_bytes / count;
    }
  }

  // Null when it is not there. A value that is found becomes protected, and the most recently used one of its shard.
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
    std::list<Entry> gone;  // freed after the lock: giving back a large body takes time
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

  // Entries of other generations leave, and are not taken from now on.
  void Retain(const std::vector<std::uint64_t>& generations) {
    for (const auto& shard : shards_) {
      std::list<Entry> gone;
      const std::lock_guard lock(shard->mutex);
      shard->retained = generations;
      for (Segment* segment : {&shard->probation, &shard->protection, &shard->ghosts}) {
        for (auto entry = segment->entries.begin(); entry != segment->entries.end();) {
          const auto here = entry++;
          if (!shard->Retains(here->key)) shard->Remove(here, gone);
        }
      }
      shard->TrimGhosts(gone);
    }
  }

  // The number of shards stays: a cache that was made small goes on with one lock.
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

  ByteCacheStats stats() const {
    ByteCacheStats stats;
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
    // To the front of `to`; the entry's node stays.
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
    // Four fifths are protected: a larger part keeps more of what was found twice, and leaves what is new less time to
    // be found again.
    void Demote() {
      while (protection.charged > budget / 5 * 4) Move(std::prev(protection.entries.end()), probation);
    }
    void Remove(Place entry, std::list<Entry>& to) {
      Segment& from = *entry->segment;
      from.charged -= entry->charge;
      index.erase(entry->key);
      to.splice(to.end(), from.entries, entry);
    }
    // What leaves stays as a ghost.
    void EvictTo(std::size_t most, std::vector<ValuePtr>& evicted) {
      while (charged() > most) {
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
