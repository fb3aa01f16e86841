// One build per key, however many ask at once.
//
// The first who asks for a key starts its flight: a job on the worker pool. Whoever asks while it is under way waits
// for the same outcome. Outcomes, failures too, go to everybody who waits and are forgotten here; keeping the good ones
// is a cache's work.
//
// Each client that waits for a flight has a job for it in the pool's queue, and the first whose turn comes builds:
// nobody waits longer because somebody else asked before.
//
// A flight is told to stop when its last waiter leaves, which each does at its own deadline at the latest, or when the
// pool is cancelled; its jobs leave the queue then. A stopped flight takes no more passengers; the next request starts
// a new one.
//
// Thread-safe, with one condition: a coroutine that waits in Join runs on a single thread (or a strand).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/jobs/waiter.h"
#include "server/jobs/worker_pool.h"

namespace terrace::server {

// Values are copied to everybody who waits.
template <typename Key, typename Value, typename Hash = std::hash<Key>>
class SingleFlight {
 public:
  using Build = Work<Value>;

  struct Landing {
    Landing() = default;
    Landing(Result<Value> v, bool j) : value(std::move(v)), joined(j) {}

    Result<Value> value;
    bool joined = false;  // false: this call started the flight
  };

  // `pool` must outlive this, and must be shut down before this is destroyed: its jobs refer to it.
  explicit SingleFlight(WorkerPool& pool) : pool_(pool) {}
  SingleFlight(const SingleFlight&) = delete;
  SingleFlight& operator=(const SingleFlight&) = delete;

  // Waits for the flight of `key`, which runs `build` in its `order` if it has to be started. `name` is for messages.
  // An exception of `build` counts as kUnavailable. kOverloaded: the pool has refused or displaced the flight's job.
  // kCancelled: the order's deadline passed, or the awaiting coroutine was cancelled. kUnavailable: the pool is
  // cancelled. Otherwise whatever `build` returned.
  asio::awaitable<Landing> Join(Key key, std::string name, Build build, JobOrder order);

  std::size_t in_flight() const {
    const std::lock_guard lock(mutex_);
    return flights_.size();
  }
  std::uint64_t joined_total() const { return joined_total_.load(std::memory_order_relaxed); }

 private:
  struct Flight;
  class Seat;
  using FlightPtr = std::shared_ptr<Flight>;

  void Launch(const FlightPtr& flight, Build build, JobOrder order);
  void Fly(const FlightPtr& flight, const Build& build);
  void Fail(const FlightPtr& flight, const PoolJob* job, Error error);
  void Land(const FlightPtr& flight, Result<Value> outcome);
  void Forget(const FlightPtr& flight);  // mutex_ is held

  WorkerPool& pool_;
  mutable std::mutex mutex_;
  std::unordered_map<Key, FlightPtr, Hash> flights_;  // those that take passengers
  std::atomic<std::uint64_t> joined_total_{0};
};

// Everything but `stop` and what is const is guarded by SingleFlight::mutex_.
template <typename Key, typename Value, typename Hash>
struct SingleFlight<Key, Value, Hash>::Flight {
  Flight(const Key& k, std::string n, std::stop_token cancelled)
      : key(k), name(std::move(n)), at_cancel(std::move(cancelled), [this] { stop.request_stop(); }) {}

  const Key key;
  const std::string name;
  std::stop_source stop;
  const std::stop_callback<std::function<void()>> at_cancel;
  bool begun = false;
  std::vector<std::weak_ptr<PoolJob>> jobs;  // one of each client, until one of them runs; the pool owns them
  std::vector<WaiterPtr> waiters;
  std::optional<Result<Value>> outcome;
};

// Holds one waiter's place; giving it back may stop the flight and withdraw its jobs. Lives in Join's frame, so that
// the place is given back however the coroutine ends.
template <typename Key, typename Value, typename Hash>
class SingleFlight<Key, Value, Hash>::Seat {
 public:
  Seat(SingleFlight& owner, FlightPtr flight, WaiterPtr waiter)
      : owner_(owner), flight_(std::move(flight)), waiter_(std::move(waiter)) {}
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;
  ~Seat() {
    std::unique_lock lock(owner_.mutex_);
    std::erase(flight_->waiters, waiter_);
    if (!flight_->waiters.empty() || flight_->outcome) return;
    owner_.Forget(flight_);
    const auto jobs = std::exchange(flight_->jobs, {});
    lock.unlock();  // stopping runs the builder's callbacks
    for (const auto& job : jobs) owner_.pool_.Withdraw(job.lock());
    flight_->stop.request_stop();
  }

 private:
  SingleFlight& owner_;
  const FlightPtr flight_;
  const WaiterPtr waiter_;
};

template <typename Key, typename Value, typename Hash>
asio::awaitable<typename SingleFlight<Key, Value, Hash>::Landing> SingleFlight<Key, Value, Hash>::Join(Key key,
                                                                                                       std::string name,
                                                                                                       Build build,
                                                                                                       JobOrder order) {
  const auto executor = co_await asio::this_coro::executor;
  const auto waiter = std::make_shared<asio::steady_timer>(executor, order.deadline);
  std::unique_lock lock(mutex_);
  if (pool_.cancelled().stop_requested()) {
    co_return Landing(MakeError(ErrorCode::kUnavailable, "the server is shutting down"), false);
  }
  const auto found = flights_.find(key);
  const bool joined = found != flights_.end();
  const FlightPtr flight = joined ? found->second : std::make_shared<Flight>(key, std::move(name), pool_.cancelled());
  flight->waiters.push_back(waiter);
  if (!joined) flights_.emplace(key, flight);
  const bool has_job = flight->begun || std::ranges::any_of(flight->jobs, [&](const auto& job) {
                         const PoolJobPtr waiting = job.lock();
                         return waiting && waiting->order.client == order.client;
                       });
  lock.unlock();
  const Seat seat(*this, flight, waiter);
  if (joined) joined_total_.fetch_add(1, std::memory_order_relaxed);
  if (!has_job) Launch(flight, std::move(build), order);

  boost::system::error_code ignored;  // landed, expired or cancelled: the outcome tells
  co_await waiter->async_wait(asio::redirect_error(asio::use_awaitable, ignored));

  lock.lock();
  std::optional<Result<Value>> outcome = flight->outcome;
  lock.unlock();
  if (!outcome) {
    outcome = MakeError(ErrorCode::kCancelled, "{}: not ready before the request's deadline", flight->name);
  }
  co_return Landing(std::move(*outcome), joined);
}

// mutex_ is not held: the pool may displace another flight's job.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Launch(const FlightPtr& flight, Build build, JobOrder order) {
  PoolJobPtr job;
  Result<void> submitted;
  try {
    job = std::make_shared<PoolJob>();
    job->order = order;
    job->run = [this, flight, build = std::move(build)] { Fly(flight, build); };
    job->displaced = [this, flight, self = job.get()] { Fail(flight, self, DisplacedError(flight->name)); };
    {
      const std::lock_guard lock(mutex_);
      flight->jobs.push_back(job);
    }
    submitted = pool_.Submit(job);
  } catch (const std::exception& thrown) {
    submitted = tl::unexpected(FailureOf(flight->name, thrown));
  }
  if (!submitted) Fail(flight, job.get(), std::move(submitted.error()));
}

// `job` will not run. Those who wait share the failure unless another client's job is to build for them.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Fail(const FlightPtr& flight, const PoolJob* job, Error error) {
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(flight->jobs, [job](const auto& known) { return known.expired() || known.lock().get() == job; });
    if (flight->begun || !flight->jobs.empty()) return;
  }
  Land(flight, tl::unexpected(std::move(error)));
}

// On a worker thread.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Fly(const FlightPtr& flight, const Build& build) {
  std::vector<std::weak_ptr<PoolJob>> others;
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(flight->begun, true) || flight->outcome) return;  // another client's turn came before
    others.swap(flight->jobs);
  }
  for (const auto& job : others) pool_.Withdraw(job.lock());
  Land(flight, Outcome(flight->name, build, flight->stop.get_token()));
}

template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Land(const FlightPtr& flight, Result<Value> outcome) {
  std::vector<WaiterPtr> waiters;
  {
    const std::lock_guard lock(mutex_);
    flight->outcome = std::move(outcome);
    waiters.swap(flight->waiters);
    Forget(flight);
  }
  for (WaiterPtr& waiter : waiters) Wake(std::move(waiter));
}

template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Forget(const FlightPtr& flight) {
  const auto found = flights_.find(flight->key);
  if (found != flights_.end() && found->second == flight) flights_.erase(found);
}

}  // namespace terrace::server
