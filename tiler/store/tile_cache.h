// The memory tier of encoded tiles.
#pragma once

#include <cstdint>

#include "tiler/encoded_tile.h"
#include "tiler/store/byte_cache.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// A request and the generation of its dataset, so that a replaced source never gets tiles of the old one. The
// generation identifies the dataset: keys stay valid while other datasets are added or removed.
struct CacheKey {
  TileRequest request;  // its `dataset` is 0
  std::uint64_t generation = 0;

  friend bool operator==(const CacheKey&, const CacheKey&) = default;
};

struct CacheKeyHash {
  std::size_t operator()(const CacheKey& key) const noexcept {
    return TileRequestHash{}(key.request) ^ static_cast<std::size_t>(key.generation);
  }
};

using TileCache = ByteCache<CacheKey, CacheKeyHash, EncodedTile>;

}  // namespace terrace::tiler
