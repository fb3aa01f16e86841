// An LRU cache of blocks with a limit in bytes.
#pragma once

#include <cstddef>
#include <functional>
#include <iterator>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

namespace terrace::dem {

// Blocks by key, up to a number of bytes or one block; the least recently used ones are dropped first. Thread-safe.
template <typename Key, typename Block, typename Hash = std::hash<Key>>
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

  // `bytes`: of the block and its entry. A block of more than the capacity is kept until the next is inserted.
  void Insert(const Key& key, BlockPtr block, std::size_t bytes) {
    std::list<Entry> gone;  // freed after the lock is released
    const std::lock_guard lock(mutex_);
    if (index_.contains(key)) return;
    bytes_ += bytes;
    entries_.push_front({key, std::move(block), bytes});
    index_.emplace(key, entries_.begin());
    while (bytes_ > capacity_bytes_ && entries_.size() > 1) Remove(std::prev(entries_.end()), gone);
  }

  void Erase(const Key& key) {
    std::list<Entry> gone;
    const std::lock_guard lock(mutex_);
    if (const auto found = index_.find(key); found != index_.end()) Remove(found->second, gone);
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

  // Moves an entry to `gone`.
  void Remove(typename std::list<Entry>::iterator entry, std::list<Entry>& gone) {
    bytes_ -= entry->bytes;
    index_.erase(entry->key);
    gone.splice(gone.end(), entries_, entry);
  }

  const std::size_t capacity_bytes_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // most recently used first
  std::unordered_map<Key, typename std::list<Entry>::iterator, Hash> index_;
  std::size_t bytes_ = 0;
};

}  // namespace terrace::dem
