// The interface of a cache tier for tiles and refinements.
//
// Implementations are thread-safe. Find may block on a disk or a network. Insert returns at once.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tiler/store/refined_tile.h"
#include "tiler/store/tile_cache.h"

namespace terrace::tiler {

template <typename Key, typename Value>
class Store {
 public:
  virtual ~Store() = default;

  // Returns a copy, or nothing if the key is absent.
  virtual std::optional<Value> Find(const Key& key) = 0;

  // Replaces the value of an existing key.
  virtual void Insert(const Key& key, std::shared_ptr<const Value> value) = 0;
};

using TileStore = Store<CacheKey, EncodedTile>;
using RefinementStore = Store<RefinedTileKey, RefinedTile>;

}  // namespace terrace::tiler
