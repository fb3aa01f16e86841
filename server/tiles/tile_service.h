// Gets tiles for requests: from memory, from a build in progress, or on the worker pool from tiler::TileTiers.
// Thread-safe. Cached tiles outlive their catalog: a new catalog finds the tiles of datasets that stay in the same
// generation.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "server/asio/asio.h"
#include "server/jobs/single_flight.h"
#include "server/jobs/worker_pool.h"
#include "server/tiles/catalog.h"
#include "tiler/store/tile_tiers.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

// Called after every build, on the thread that ran it.
using BuildObserver = std::function<void(const DatasetView&, const Result<tiler::TilePtr>&)>;

struct TileServiceOptions {
  std::size_t cache_bytes = std::size_t{256} << 20;            // 0: no cache
  std::vector<std::shared_ptr<tiler::TileStore>> stores = {};  // see tiler::TileTiers
  tiler::HeaderWriter write_header_lines = nullptr;            // see tiler::TileTiers; called on a worker
};

enum class CacheStatus { kHit, kStore, kMiss, kJoined };  // kStore: in a tier below memory

struct ServedTile {
  ServedTile() = default;
  ServedTile(tiler::TilePtr t, CacheStatus c) : tile(std::move(t)), cache(c) {}

  tiler::TilePtr tile;
  CacheStatus cache = CacheStatus::kMiss;
};

class TileService {
 public:
  // Tiles are built on `workers`, which must be shut down before this object is destroyed.
  explicit TileService(WorkerPool& workers, TileServiceOptions options = {}, BuildObserver observer = nullptr);

  // Returns the tile if it is in the cache, and counts a hit. May be called on any thread.
  std::optional<ServedTile> Find(const Catalog& catalog, const tiler::TileRequest& request);

  // For tiles that Find has not found: counts a miss, and joins a flight or starts one, which looks in the stores and
  // builds the tile if none has it. Errors: those of TilePipeline::Build, and kOverloaded and kCancelled of
  // SingleFlight::Join. Errors are not cached. The coroutine must run on a single thread. `client`: of JobTerms
  // (fair_queue.h). Precondition: the request names one of the datasets.
  asio::awaitable<Result<ServedTile>> Build(CatalogPtr catalog, tiler::TileRequest request,
                                            JobClock::time_point deadline, std::uint64_t client = 0);

  // Removes from memory the tiles of datasets that are not in `catalog`, and the tiles whose edits have changed. From
  // now on tiles of datasets that are not in `catalog` are not inserted; a build that has begun may still insert a tile
  // with the old edits.
  void RetainTilesOf(const Catalog& catalog);

  // Call it before `catalog` is served: until the next RetainTilesOf its tiles are inserted, too.
  void AlsoRetainTilesOf(const Catalog& catalog);

  // TileTiers::Erase.
  Result<tiler::TileTiers::Erased> Erase(const tiler::TileSelection& selection, const std::stop_token& stop = {}) {
    return tiers_.Erase(selection, stop);
  }

  void SetCacheBytes(std::size_t capacity);

  struct Stats {
    std::uint64_t hits = 0;                              // found in memory
    std::uint64_t misses = 0;                            // calls of Build, which may join a flight
    std::uint64_t joined = 0;                            // waited for the same work as another request
    std::uint64_t refused = 0;                           // requests for tiles refused as overloaded
    std::vector<std::chrono::microseconds> store_times;  // TileTiers::store_times
    std::size_t in_flight = 0;                           // builds under way or waiting
    tiler::CacheStats cache;
  };
  Stats stats() const;

 private:
  const BuildObserver observer_;
  tiler::TileTiers tiers_;
  std::atomic<bool> had_edits_{false};  // of the last catalog
  SingleFlight<tiler::CacheKey, tiler::TilePtr, tiler::CacheKeyHash> flights_;
  std::atomic<std::uint64_t> hits_{0}, misses_{0}, refused_{0};
};

}  // namespace terrace::server
