#include "tiler/store/refinement_cache.h"

#include <utility>

namespace terrace::tiler {

RefinedTilePtr RefinementCache::Find(const RefinedTileKey& key) {
  if (RefinedTilePtr tile = memory_.Find(key)) {
    hits_.fetch_add(1, std::memory_order_relaxed);
    return tile;
  }
  misses_.fetch_add(1, std::memory_order_relaxed);
  if (!below_) return nullptr;
  std::optional<RefinedTile> found = below_->Find(key);
  if (!found) return nullptr;
  auto tile = std::make_shared<const RefinedTile>(*std::move(found));
  memory_.Insert(key, tile);
  return tile;
}

void RefinementCache::Insert(const RefinedTileKey& key, RefinedTilePtr tile) {
  if (below_) below_->Insert(key, tile);
  memory_.Insert(key, std::move(tile));
}

ByteCacheStats RefinementCache::stats() const {
  ByteCacheStats stats = memory_.stats();
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  return stats;
}

}  // namespace terrace::tiler
