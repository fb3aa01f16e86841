// The tiers of tiles, from memory down to a build. A tile is looked up in memory, then in each store in order. The tier
// that has it fills the tiers above. If none has it, it is built, and goes into all of them. A store may drop it.
// Memory does not keep very large tiles. The limit is a 16th of `memory_bytes`; if `memory_bytes` is below 64 MiB, it
// is `memory_bytes`.
//
// Thread-safe. Two threads that ask for the same tile at once may both build it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "tiler/store/tile_store.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

template <typename Key, typename Hash, typename Value>
class ByteCache;  // tiler/store/byte_cache.h, which is not installed
using TileCache = ByteCache<CacheKey, CacheKeyHash, EncodedTile>;

// Writes those header lines of a reply that describe the tile. The TileRequest is CacheKey::request, whose `dataset` is
// 0.
using HeaderWriter = HeaderLines (*)(const TileRequest&, const EncodedTile&);

class TileTiers {
 public:
  // `memory_bytes`: 0 keeps no tiles in memory. `stores`: below memory, the fastest first; none is null.
  // `write_header_lines`: called once for each tile that is built or found in a store; its lines are cached with the
  // tile. Null: they stay empty.
  TileTiers(std::size_t memory_bytes, std::vector<std::shared_ptr<TileStore>> stores,
            HeaderWriter write_header_lines = nullptr);
  ~TileTiers();

  // The tier in memory, for the server, which looks there without blocking. FindOrBuild looks there first.
  TileCache& memory() { return *memory_; }
  const TileCache& memory() const { return *memory_; }

  // `build` is called if no tier has the tile. Its error is returned and not kept; its exceptions pass. Blocks.
  Result<TilePtr> FindOrBuild(const CacheKey& key, const std::function<Result<EncodedTile>()>& build);

  // How many tiles were erased.
  struct Erased {
    std::size_t memory = 0;
    std::vector<std::pair<const char*, std::size_t>> stores;  // with the store's name; the slowest first
  };
  // Erases the selected tiles from all tiers, also if one of them fails. Calls of FindOrBuild that have begun may
  // insert such tiles afterwards. Blocks. Errors: those of the stores.
  Result<Erased> Erase(const TileSelection& selection, const std::stop_token& stop = {});

  // The sum of the durations of look-ups in each store.
  std::vector<std::chrono::microseconds> store_times() const;

 private:
  TilePtr Keep(const CacheKey& key, EncodedTile tile, std::size_t stores_above);

  const std::unique_ptr<TileCache> memory_;
  const std::vector<std::shared_ptr<TileStore>> stores_;
  const HeaderWriter write_header_lines_;
  std::vector<std::atomic<std::int64_t>> store_times_;  // microseconds
};

}  // namespace terrace::tiler
