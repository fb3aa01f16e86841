// Where what the pipeline made is kept between requests: the interface that each tier of a cache implements.
//
// Implementations are thread-safe. Find may block, where a tier is a disk or a network; Insert returns at once.
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

  // A copy of the caller's own; nothing when it is not there.
  virtual std::optional<Value> Find(const Key& key) = 0;

  // Later values of a key replace earlier ones.
  virtual void Insert(const Key& key, std::shared_ptr<const Value> value) = 0;
};

using TileStore = Store<CacheKey, EncodedTile>;
using RefinementStore = Store<RefinedTileKey, RefinedTile>;

}  // namespace terrace::tiler
