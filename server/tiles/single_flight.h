// One build per key, however many ask at once.
//
// The first who asks for a key starts its flight: a job on the worker pool. Whoever asks while it is under way waits
// for the same outcome. Outcomes, failures too, go to everybody who waits and are forgotten here; keeping the good ones
// is the cache's work.
//
// Each client that waits for a flight has a job for it in the pool's queue, and the first whose turn comes builds:
// nobody waits longer because somebody else asked before.
//
// A flight is told to stop when its last waiter leaves, which each does at its own deadline at the latest, or at
// shutdown; its jobs leave the queue then. A stopped flight takes no more passengers; the next
// request starts a new one.
//
// Thread-safe, with one condition: a coroutine that waits in Join runs on a single thread (or a strand).
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <unordered_map>
#include <utility>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/tiles/worker_pool.h"
#include "tiler/store/tile_cache.h"

namespace terrace::server {

class SingleFlight {
 public:
  using Clock = std::chrono::steady_clock;
  using Build = std::function<Result<tiler::TilePtr>(std::stop_token)>;
  using Work = std::function<Result<tiler::EncodedTile>(std::stop_token)>;

  struct Landing {
    Landing() = default;
    Landing(Result<tiler::TilePtr> t, bool j) : tile(std::move(t)), joined(j) {}

    Result<tiler::TilePtr> tile;
    bool joined = false;  // false: this call started the flight
  };

  // `pool` must outlive this, and must be shut down before this is destroyed: its jobs refer to it.
  explicit SingleFlight(WorkerPool& pool) : pool_(pool) {}
  SingleFlight(const SingleFlight&) = delete;
  SingleFlight& operator=(const SingleFlight&) = delete;

  // Waits for the flight of `key`, which runs `build` in its `order` if it has to be started. An exception of `build`
  // counts as kUnavailable. kOverloaded: the pool has refused or displaced the flight's job. kCancelled: `deadline`
  // passed, or the awaiting coroutine was cancelled. kUnavailable: shutting down. Otherwise whatever `build` returned.
  asio::awaitable<Landing> Join(tiler::CacheKey key, Build build, Clock::time_point deadline, JobOrder order = {});

  // Stops every flight and starts no more.
  void Shutdown();

  std::size_t in_flight() const;
  std::uint64_t joined_total() const { return joined_total_.load(std::memory_order_relaxed); }

 private:
  struct Flight;
  class Seat;

  using FlightPtr = std::shared_ptr<Flight>;

  void Launch(const tiler::CacheKey& key, const FlightPtr& flight, Build build, JobOrder order);
  void Fly(const tiler::CacheKey& key, const FlightPtr& flight, const Build& build);
  void Fail(const tiler::CacheKey& key, const FlightPtr& flight, const PoolJob* job, Error error);
  void Land(const tiler::CacheKey& key, const FlightPtr& flight, Result<tiler::TilePtr> outcome);
  void Forget(const tiler::CacheKey& key, const FlightPtr& flight);  // mutex_ is held

  WorkerPool& pool_;
  mutable std::mutex mutex_;
  std::unordered_map<tiler::CacheKey, FlightPtr, tiler::CacheKeyHash> flights_;  // those that take passengers
  bool shut_down_ = false;
  std::atomic<std::uint64_t> joined_total_{0};
};

}  // namespace terrace::server
