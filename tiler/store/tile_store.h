// The interface of a cache tier. To add a tier, write a class that implements TileStore, and pass an object to
// TileTiers.
//
// Implementations are thread-safe. Find, Erase and Flush may block on a disk or a network. Insert puts the value into a
// queue. If the queue is full, it drops the value, or waits if the tier is configured so. The other functions return at
// once.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>

#include "engine/core/result.h"
#include "tiler/store/cache_stats.h"
#include "tiler/store/tile_selection.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

// A request, and what its tile depends on besides. If the generation comes from GenerationOf, keys stay valid while
// other datasets are added or removed, and a dataset whose source was replaced never gets tiles of the old source. If
// the generation is a position (Dataset::generation), neither holds.
struct CacheKey {
  TileRequest request;  // its `dataset` is 0
  // Dataset::cache_generation() of the dataset in TilePipeline::datasets(). The pipeline has set a generation that was
  // left at 0.
  std::uint64_t generation = 0;
  // TileEditsHash (tiler/dataset.h): the edits that the tile depends on. 0 for a dataset that has only baked tiles.
  std::uint64_t edits = 0;

  friend bool operator==(const CacheKey&, const CacheKey&) = default;
};

struct CacheKeyHash {
  std::size_t operator()(const CacheKey& key) const noexcept {
    return TileRequestHash{}(key.request) ^ static_cast<std::size_t>(key.generation ^ key.edits);
  }
};

inline bool IsSelected(const TileSelection& selection, const CacheKey& key) {
  return selection.Contains(key.generation, key.request.key, IsMercator(key.request.format));
}

struct StoreStats : CacheStats {  // entries and bytes: approximate; 0 if the store does not know them
  std::uint64_t errors = 0;       // reads and writes that failed
  std::uint64_t damaged = 0;      // records that are not intact; the store erases them if it can
  std::uint64_t written = 0;
  std::uint64_t dropped = 0;  // changes not written: the medium failed, the queue was full, or Abandon was called
  bool on = false;            // reads work, and writes if the store writes at all
  // For a store on a network: look-ups that timed out; look-ups that were skipped, because the store is off or seldom
  // has such tiles; how often it was switched off.
  std::uint64_t timeouts = 0, skipped = 0, switched_off = 0;
};

class StoreBase {
 public:
  virtual ~StoreBase() = default;

  // A literal: what metrics and Server-Timing call the tier.
  virtual const char* name() const = 0;
  virtual StoreStats stats() const = 0;

  // Erases the values of these tiles, also those that wait to be written, and returns their number. After an error,
  // values may be left. kCancelled: `stop` was requested. kUnavailable: the medium does not respond. kInternal: a
  // record is damaged.
  virtual Result<std::size_t> Erase(const TileSelection& selection, const std::stop_token& stop) = 0;

  // Returns when everything that was inserted before the call is written or dropped.
  virtual void Flush() {}

  // Drops values that wait to be written, and accepts no more. For a process that must end at once. TileTiers calls
  // neither Flush nor Abandon.
  virtual void Abandon() = 0;
};

template <typename Key, typename Value>
class Store : public StoreBase {
 public:
  // Returns a copy; nothing if the key is absent or cannot be read. Of a tile, a store keeps `bytes`, `etag`,
  // `max_error_m`, `certified_error_m`, `vertices` and `triangles`. The other members have their defaults. TileTiers
  // then sets `found_in` and `header_lines`.
  virtual std::optional<Value> Find(const Key& key) = 0;

  // Stores a value, and replaces the one that the key had.
  virtual void Insert(const Key& key, std::shared_ptr<const Value> value) = 0;

  // Called by TileTiers if Find found nothing and the tile could not be built, so that no Insert follows. For stores
  // that keep something for this Insert, such as a lock.
  virtual void GiveUp(const Key&) {}
};

using TileStore = Store<CacheKey, EncodedTile>;

}  // namespace terrace::tiler
