// The interface of a cache tier. To add a tier, write a class that implements TileStore, and pass an object to
// TileTiers. The server passes those in ServerOptions::tile_stores (server/server.h). A tier for refinements implements
// RefinementStore (refinement_cache.h).
//
// Implementations are thread-safe. Find, Erase and Flush may block on a disk or a network. Insert drops values if its
// queue is full; only a tier that is configured to wait for room instead may block in Insert. The other functions
// return at once.
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

// A request and the generation of its dataset. If Dataset::generation was set to GenerationOf, a replaced source never
// gets tiles of the old one, and keys stay valid while other datasets are added or removed. If it was left at 0, the
// generation is a position, and neither holds (tiler/dataset.h).
struct CacheKey {
  TileRequest request;  // its `dataset` is 0
  // Dataset::cache_generation() of the dataset in TilePipeline::datasets(). That of the Dataset that was passed to the
  // pipeline may still be 0.
  std::uint64_t generation = 0;
  // TileEditsHash (tiler/dataset.h): only of edits that the tile depends on, so that a change of an edit leaves other
  // tiles valid. 0 for a dataset that has only baked tiles.
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
  bool on = false;  // finding works, and writing if the store writes at all; false: switched off, or one of them fails
  // For a store on a network: look-ups that timed out; look-ups that were skipped, because the store was switched off
  // or seldom has such tiles; how often it was switched off.
  std::uint64_t timeouts = 0, skipped = 0, switched_off = 0;
};

class StoreBase {
 public:
  virtual ~StoreBase() = default;

  // A literal: what metrics and Server-Timing call the tier.
  virtual const char* name() const = 0;
  virtual StoreStats stats() const = 0;

  // Erases the values of these tiles, also those that wait to be written, and returns their number. kCancelled:
  // stopped, and values may be left. kUnavailable: the medium does not respond, and values may be left.
  virtual Result<std::size_t> Erase(const TileSelection& selection, const std::stop_token& stop) = 0;

  // Returns when everything that was inserted before the call is written or dropped.
  virtual void Flush() {}

  // Drops values that wait to be written, and accepts no more. For a process that must end at once. TileTiers calls
  // neither Flush nor Abandon, also not when it is destroyed.
  virtual void Abandon() = 0;
};

template <typename Key, typename Value>
class Store : public StoreBase {
 public:
  // Returns a copy, or nothing if the key is absent or cannot be read. A store keeps these members of a tile: `bytes`,
  // `etag`, `max_error_m`, `certified_error_m`, `vertices` and `triangles`. Find leaves the others at their defaults;
  // TileTiers then sets `found_in` and `header_lines`.
  virtual std::optional<Value> Find(const Key& key) = 0;

  // Replaces the value of an existing key.
  virtual void Insert(const Key& key, std::shared_ptr<const Value> value) = 0;

  // Called if Find found nothing and the build then failed or was cancelled: no Insert of the key follows. A store that
  // keeps something for this Insert releases it. TileTiers calls it, RefinementCache does not.
  virtual void GiveUp(const Key&) {}
};

using TileStore = Store<CacheKey, EncodedTile>;

}  // namespace terrace::tiler
