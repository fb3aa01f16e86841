#include "tiler/store/tile_tiers.h"

#include <optional>
#include <utility>

#include "engine/core/elapsed_time.h"
#include "tiler/store/byte_cache.h"

namespace terrace::tiler {

TileTiers::TileTiers(std::size_t memory_bytes, std::vector<std::shared_ptr<TileStore>> stores,
                     HeaderWriter write_header_lines)
    : memory_(std::make_unique<TileCache>(memory_bytes)),
      stores_(std::move(stores)),
      write_header_lines_(write_header_lines),
      store_times_(stores_.size()) {}

TileTiers::~TileTiers() = default;

Result<TilePtr> TileTiers::FindOrBuild(const CacheKey& key, const std::function<Result<EncodedTile>()>& build) {
  if (TilePtr tile = memory_->Find(key)) return tile;
  for (std::size_t i = 0; i < stores_.size(); ++i) {
    const auto begun = std::chrono::steady_clock::now();
    std::optional<EncodedTile> found = stores_[i]->Find(key);
    store_times_[i].fetch_add(MicrosecondsSince(begun).count(), std::memory_order_relaxed);
    if (!found) continue;
    found->found_in = stores_[i]->name();
    return Keep(key, *std::move(found), i);
  }
  const auto give_up = [&] {
    for (const auto& store : stores_) store->GiveUp(key);
  };
  try {
    Result<EncodedTile> built = build();
    if (built) return Keep(key, *std::move(built), stores_.size());
    give_up();
    return tl::unexpected(std::move(built.error()));
  } catch (...) {
    give_up();
    throw;
  }
}

// The tile as it is sent, after it was inserted into memory and the first `stores_above` stores.
TilePtr TileTiers::Keep(const CacheKey& key, EncodedTile tile, std::size_t stores_above) {
  if (write_header_lines_ != nullptr) tile.header_lines = write_header_lines_(key.request, tile);
  tile.bytes.shrink_to_fit();  // encoders reserve more than they fill, and memory keeps the tile for long
  auto kept = std::make_shared<const EncodedTile>(std::move(tile));
  memory_->Insert(key, kept);
  for (std::size_t i = 0; i < stores_above; ++i) stores_[i]->Insert(key, kept);
  return kept;
}

// The slowest tier first and memory last: a tile that is found in a tier meanwhile goes into the tiers above it.
Result<TileTiers::Erased> TileTiers::Erase(const TileSelection& selection, const std::stop_token& stop) {
  Erased erased;
  Result<void> done;
  for (auto store = stores_.rbegin(); store != stores_.rend(); ++store) {
    Result<std::size_t> of_store = (*store)->Erase(selection, stop);
    if (of_store) {
      erased.stores.emplace_back((*store)->name(), *of_store);
    } else {
      done = tl::unexpected(std::move(of_store.error()));
    }
  }
  erased.memory = memory_->EraseIf([&](const CacheKey& key) { return IsSelected(selection, key); });
  if (!done) return tl::unexpected(std::move(done.error()));
  return erased;
}

std::vector<std::chrono::microseconds> TileTiers::store_times() const {
  std::vector<std::chrono::microseconds> times;
  for (const auto& time : store_times_) times.emplace_back(time.load(std::memory_order_relaxed));
  return times;
}

}  // namespace terrace::tiler
