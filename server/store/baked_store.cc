#include "server/store/baked_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <mutex>
#include <utility>

namespace terrace::server {

void BakedStore::Use(const std::vector<tiler::Dataset>& datasets) {
  std::multimap<std::uint64_t, Archive> baked;
  for (const tiler::Dataset& dataset : datasets) {
    if (dataset.baked) baked.emplace(dataset.cache_generation(), Archive{dataset.baked, dataset.model});
  }
  const std::unique_lock lock(mutex_);
  baked_.swap(baked);
  reported_.clear();
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
