// Tiles for requests: from memory, from a flight that is under way, or on the worker pool from disk or from a new
// build.
//
// Thread-safe. How a tile is built is the catalog's business: this class knows neither elevation models nor codecs.
// Tiles outlive the catalog they came from: the next one finds those of datasets that it has in the same generation.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/tiles/catalog.h"
#include "server/tiles/disk_cache.h"
#include "server/tiles/single_flight.h"
#include "server/tiles/worker_pool.h"
#include "tiler/encoded_tile.h"
#include "tiler/store/tile_cache.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// Told about every build on the thread that ran it.
using BuildObserver = std::function<void(const DatasetView&, const Result<tiler::TilePtr>&)>;

struct TileServiceOptions {
  unsigned worker_threads = 0;                       // 0: as many as the machine has processors
  std::size_t queue_length = 10'000;                 // jobs that wait for a worker, of all clients
  std::size_t cache_bytes = std::size_t{256} << 20;  // 0: no cache
  std::shared_ptr<DiskCache> disk;                   // null: none
};

enum class CacheStatus { kHit, kDisk, kMiss, kJoined };

struct ServedTile {
  ServedTile() = default;
  ServedTile(tiler::TilePtr t, CacheStatus c) : tile(std::move(t)), cache(c) {}

  tiler::TilePtr tile;
  CacheStatus cache = CacheStatus::kMiss;
};

class TileService {
 public:
  using Clock = SingleFlight::Clock;

  explicit TileService(TileServiceOptions options, BuildObserver observer = nullptr);
  ~TileService();

  // The tile if it is in the cache; counts as a hit then. From any thread.
  std::optional<ServedTile> Find(const Catalog& catalog, const tiler::TileRequest& request);

  // Errors: those of the catalog's builder, and kOverloaded, kCancelled, kUnavailable of SingleFlight::Join. The
  // coroutine has to run on a single thread. Only successes are kept. `client`: whose turn it takes (JobOrder).
  // Precondition: the request names one of the datasets.
  asio::awaitable<Result<ServedTile>> Get(CatalogPtr catalog, tiler::TileRequest request, Clock::time_point deadline,
                                          std::uint64_t client = 0);

  // Runs `work` on a worker for this caller alone: nothing is shared or kept. Errors and conditions as those of Get. An
  // exception of `work` counts as kUnavailable. Long work has at most all workers but one, of several, and waits until
  // it may: tiles go on being served beside it.
  enum class Length { kShort, kLong };
  asio::awaitable<Result<tiler::TilePtr>> Run(SingleFlight::Work work, Length length, Clock::time_point deadline,
                                              std::uint64_t client = 0);

  // Tiles of datasets that are not in `catalog` leave the cache, and builds of them that land later stay out of it.
  void RetainTilesOf(const Catalog& catalog);
  void SetCacheBytes(std::size_t capacity) { cache_.SetCapacity(capacity); }

  // Makes every Get that waits for a build fail soon, and every later one at once; the cache keeps answering.
  void CancelBuilds();

  // CancelBuilds, then waits for the workers to end.
  void Shutdown();

  struct Stats {
    std::uint64_t hits = 0, misses = 0, joined = 0;
    std::size_t queued = 0, in_flight = 0;
    tiler::ByteCacheStats cache;
    std::optional<DiskCacheStats> disk;  // nothing: there is none
  };
  Stats stats() const;

 private:
  Result<tiler::TilePtr> BuildAndKeep(const Catalog& catalog, const tiler::TileRequest& request,
                                      const tiler::CacheKey& key, Clock::time_point asked, std::stop_token stop);

  const BuildObserver observer_;
  tiler::TileCache cache_;
  const std::shared_ptr<DiskCache> disk_;
  WorkerPool pool_;
  SingleFlight flights_;
  std::atomic<std::uint64_t> hits_{0}, misses_{0}, solos_{0};
};

}  // namespace terrace::server
