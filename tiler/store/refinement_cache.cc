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

// The slower tier first: what is found there meanwhile goes into memory.
Result<RefinementCache::Erased> RefinementCache::Erase(const TileSelection& selection, const std::stop_token& stop) {
  Result<std::size_t> below = 0;
  if (below_) below = below_->Erase(selection, stop);
  Erased erased;
  erased.memory = memory_.EraseIf([&](const RefinedTileKey& key) { return IsSelected(selection, key); });
  if (!below) return tl::unexpected(std::move(below.error()));
  erased.below = *below;
  return erased;
}

CacheStats RefinementCache::stats() const {
  CacheStats stats = memory_.stats();
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  return stats;
}

}  // namespace terrace::tiler
