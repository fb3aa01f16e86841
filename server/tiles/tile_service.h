// Tiles for requests: from memory, from a flight that is under way, or on the worker pool from disk or from a new
// build.
//
// Thread-safe. How a tile is built is the catalog's business: this class knows neither elevation models nor codecs.
// Tiles outlive the catalog they came from: the next one finds those of datasets that it has in the same generation.
// The pool also runs what is made for one request alone (heights, meshes of areas, documents).
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/jobs/single_flight.h"
#include "server/jobs/worker_pool.h"
#include "server/tiles/catalog.h"
#include "tiler/encoded_tile.h"
#include "tiler/store/tile_cache.h"
#include "tiler/store/tile_store.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// Told about every build on the thread that ran it.
using BuildObserver = std::function<void(const DatasetView&, const Result<tiler::TilePtr>&)>;

// Writes what a reply's head says of a tile in its body. Called once a tile, on a worker; kept with the tile.
using HeadWriter = tiler::HeadLines (*)(const tiler::TileRequest&, const tiler::EncodedTile&);

struct TileServiceOptions {
  unsigned worker_threads = 0;                       // 0: as many as the machine has processors
  std::size_t queue_length = 10'000;                 // jobs that wait for a worker, of all clients
  std::size_t cache_bytes = std::size_t{256} << 20;  // 0: no cache
  // Tiers below memory, the first asked first. Each gets every tile that is built.
  std::vector<std::shared_ptr<tiler::TileStore>> stores = {};
  HeadWriter write_head = nullptr;  // null: heads are left empty
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
  using Clock = JobClock;

  explicit TileService(TileServiceOptions options, BuildObserver observer = nullptr);
  ~TileService();

  // The tile if it is in the cache; counts as a hit then. From any thread.
  std::optional<ServedTile> Find(const Catalog& catalog, const tiler::TileRequest& request);

  // What Find has not found: joins its flight, or starts one. Errors: those of the catalog's builder, and kOverloaded,
  // kCancelled, kUnavailable of SingleFlight::Join. The coroutine has to run on a single thread. Only successes are
  // kept. `client`: whose turn it takes (JobOrder). Precondition: the request names one of the datasets.
  asio::awaitable<Result<ServedTile>> Build(CatalogPtr catalog, tiler::TileRequest request, Clock::time_point deadline,
                                            std::uint64_t client = 0);

  // Runs `work` on a worker for this caller alone: nothing is shared or kept. Errors and conditions: WorkerPool::Run.
  // Long work has at most all workers but one, of several, and waits until it may: tiles go on being served beside it.
  enum class Length { kShort, kLong };
  template <typename T>
  asio::awaitable<Result<T>> Run(Work<T> work, Length length, Clock::time_point deadline, std::uint64_t client = 0) {
    return pool_.Run<T>(std::move(work), OrderOf(length, deadline, client));
  }

  // Tiles of datasets that are not in `catalog` leave the cache, and builds of them that land later stay out of it.
  void RetainTilesOf(const Catalog& catalog);
  void SetCacheBytes(std::size_t capacity) { cache_.SetCapacity(capacity); }

  // Makes every Build and Run that waits fail soon, and every later one at once; the cache keeps answering.
  void CancelBuilds() { pool_.Cancel(); }

  // CancelBuilds, then waits for the workers to end.
  void Shutdown() { pool_.Shutdown(); }

  struct Stats {
    std::uint64_t hits = 0, misses = 0, joined = 0;
    std::size_t queued = 0, in_flight = 0;
    tiler::ByteCacheStats cache;
  };
  Stats stats() const;

 private:
  static JobOrder OrderOf(Length length, Clock::time_point deadline, std::uint64_t client);
  tiler::TilePtr Finish(const tiler::TileRequest& request, tiler::EncodedTile tile) const;
  Result<tiler::TilePtr> BuildAndKeep(const Catalog& catalog, const tiler::TileRequest& request,
                                      const tiler::CacheKey& key, Clock::time_point asked, std::stop_token stop);

  const BuildObserver observer_;
  const HeadWriter write_head_;
  tiler::TileCache cache_;
  const std::vector<std::shared_ptr<tiler::TileStore>> stores_;
  WorkerPool pool_;
  SingleFlight<tiler::CacheKey, tiler::TilePtr, tiler::CacheKeyHash> flights_;
  std::atomic<std::uint64_t> hits_{0}, misses_{0};
};

}  // namespace terrace::server
