// An LRU cache of blocks with a limit in bytes.
#pragma once

#include <cstddef>
#include <iterator>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

namespace terrace::dem {

// Blocks by key, up to a number of bytes; the least recently used ones are dropped first. Thread-safe.
template <typename Key, typename Block, typename Hash>
class LruBlockCache {
 public:
  using BlockPtr = std::shared_ptr<const Block>;

  explicit LruBlockCache(std::size_t capacity_bytes) : capacity_bytes_(capacity_bytes) {}

  BlockPtr Find(const Key& key) {  // null: not kept
    const std::lock_guard lock(mutex_);
    const auto found = index_.find(key);
    if (found == index_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, found->second);
    return found->second->block;
  }

  // `bytes`: of the block and its entry. A block of more than the capacity is not kept.
  void Insert(const Key& key, BlockPtr block, std::size_t bytes) {
    std::list<Entry> gone;  // freed after the lock is released
    const std::lock_guard lock(mutex_);
    if (index_.contains(key) || bytes > capacity_bytes_) return;
    bytes_ += bytes;
    entries_.push_front({key, std::move(block), bytes});
    index_.emplace(key, entries_.begin());
    while (bytes_ > capacity_bytes_) {
      bytes_ -= entries_.back().bytes;
      index_.erase(entries_.back().key);
      gone.splice(gone.end(), entries_, std::prev(entries_.end()));
    }
  }

  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return entries_.size();
  }
  std::size_t bytes() const {
    const std::lock_guard lock(mutex_);
    return bytes_;
  }

 private:
  struct Entry {
    Key key;
    BlockPtr block;
    std::size_t bytes;
  };

  const std::size_t capacity_bytes_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<Key, typename std::list<Entry>::iterator, Hash> index_;
  std::size_t bytes_ = 0;
};

}  // namespace terrace::dem
