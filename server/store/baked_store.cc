#include "server/store/baked_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <mutex>
#include <utility>

namespace terrace::server {

std::multimap<std::uint64_t, BakedStore::Archive> BakedStore::ArchivesOf(const std::vector<tiler::Dataset>& datasets) {
  std::multimap<std::uint64_t, Archive> archives;
  for (const tiler::Dataset& dataset : datasets) {
    if (dataset.baked) archives.emplace(dataset.cache_generation(), Archive{dataset.baked, dataset.model});
  }
  return archives;
}

void BakedStore::Use(const std::vector<tiler::Dataset>& datasets) {
  std::multimap<std::uint64_t, Archive> baked = ArchivesOf(datasets);  // the old ones are destroyed without the lock
  const std::unique_lock lock(mutex_);
  baked_.swap(baked);
  reported_.clear();
}

void BakedStore::AlsoUse(const std::vector<tiler::Dataset>& datasets) {
  std::multimap<std::uint64_t, Archive> added = ArchivesOf(datasets);
  const std::unique_lock lock(mutex_);
  baked_.merge(added);
}

std::optional<tiler::EncodedTile> BakedStore::Find(const tiler::CacheKey& key) {
  std::shared_ptr<const tiler::BakedTiles> baked;
  {
    const std::shared_lock lock(mutex_);
    // Datasets may differ only in their edits.
    const auto [first, last] = baked_.equal_range(key.generation);
    const auto found = std::find_if(first, last, [&](const auto& entry) {
      const auto& model = entry.second.model;
      return (model ? tiler::TileEditsHash(*model, key.request) : 0) == key.edits;
    });
    if (found == last) return std::nullopt;
    baked = found->second.tiles;
  }
  Result<std::optional<tiler::EncodedTile>> tile = baked->Find(key.request);
  if (!tile) {
    ++errors_;
    Report(tile.error().message);
    return std::nullopt;
  }
  ++(*tile ? hits_ : misses_);
  return *std::move(tile);
}

void BakedStore::Report(const std::string& fault) {
  constexpr std::size_t kMaxReported = 1000;
  {
    const std::unique_lock lock(mutex_);
    if (reported_.size() >= kMaxReported || !reported_.insert(fault).second) return;
  }
  spdlog::error("archive: {}; tiles are built where the dataset has sources", fault);
}

tiler::StoreStats BakedStore::stats() const {
  tiler::StoreStats stats;
  stats.hits = hits_;
  stats.misses = misses_;
  stats.errors = errors_;
  stats.on = true;
  return stats;
}

}  // namespace terrace::server
