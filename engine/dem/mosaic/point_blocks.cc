#include "engine/dem/mosaic/point_blocks.h"

#include <utility>

namespace terrace::dem {
namespace {

constexpr std::size_t kNoted = 4096;

}  // namespace

std::size_t PointBlockCache::Hash::operator()(const PointBlockKey& key) const noexcept {
  std::uint64_t hash = key.grid * 0x9E3779B97F4A7C15;
  for (const std::int64_t number : {key.column, key.row}) {
    hash = (hash ^ static_cast<std::uint64_t>(number)) * 0xBF58476D1CE4E5B9;
    hash ^= hash >> 29;
  }
  return hash;
}

PointBlockCache& PointBlockCache::Shared() {
  static auto* const cache = new PointBlockCache();
  return *cache;
}

PointBlockPtr PointBlockCache::Find(const PointBlockKey& key) {
  const std::lock_guard lock(mutex_);
  const auto found = index_.find(key);
  if (found == index_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second->block;
}

void PointBlockCache::Insert(const PointBlockKey& key, PointBlockPtr block) {
  std::list<Entry> gone;  // freed after the lock is released
  const std::lock_guard lock(mutex_);
  if (index_.contains(key) || block->bytes() > capacity_bytes_) return;
  bytes_ += block->bytes();
  entries_.push_front({key, std::move(block)});
  index_.emplace(key, entries_.begin());
  while (bytes_ > capacity_bytes_) {
    bytes_ -= entries_.back().block->bytes();
    index_.erase(entries_.back().key);
    gone.splice(gone.end(), entries_, std::prev(entries_.end()));
  }
}

bool PointBlockCache::Note(const PointBlockKey& key) {
  const std::lock_guard lock(mutex_);
  noted_.resize(kNoted);
  return std::exchange(noted_[Hash{}(key) % kNoted], key) == key;
}

std::size_t PointBlockCache::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace terrace::dem
