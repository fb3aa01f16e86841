// One build per key, however many requests ask for it at the same time.
//
// The first request for a key starts a flight: a job on the worker pool. Requests that come during the flight wait for
// its outcome. All waiters get the outcome, also if it is an error. Outcomes are not kept here; that is a cache's task.
//
// Each client that waits for a flight has a job for it in the pool's queue. The first of these jobs whose turn comes
// does the build: no request waits longer because another client asked before.
//
// Waiters leave at their deadlines at the latest. When the last one leaves, the flight is stopped, and its jobs are
// removed from the queue. It is also stopped when the pool is cancelled; its jobs then run and end at once. A stopped
// flight accepts no further waiters; the next request starts a new one.
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
#include "server/asio/asio.h"
#include "server/jobs/worker_pool.h"

namespace terrace::server {

// Each waiter gets a copy of the value.
template <typename Key, typename Value, typename Hash = std::hash<Key>>
class SingleFlight {
 public:
  using BuildWork = Work<Value>;

  struct FlightResult {
    FlightResult() = default;
    FlightResult(Result<Value> v, bool j) : value(std::move(v)), joined(j) {}

    Result<Value> value;
    bool joined = false;  // false: this call started the flight
  };

  // `pool` must outlive this object and must be shut down before its destruction, because jobs refer to it.
  explicit SingleFlight(WorkerPool& pool) : pool_(pool) {}
  SingleFlight(const SingleFlight&) = delete;
  SingleFlight& operator=(const SingleFlight&) = delete;

  // Waits for the flight of `key`, or starts one. Each client that joins queues its own `build` with its `terms`, and
  // the first that a worker takes runs: builds of one key must be equivalent. `name` is for messages. An exception of
  // `build` counts as FailureOf says. kOverloaded: the pool refused or dropped all jobs of the flight. kCancelled: the
  // deadline passed, the awaiting coroutine was cancelled, or the pool was cancelled before `build` began. Otherwise
  // the result of `build`.
  asio::awaitable<FlightResult> Join(Key key, std::string name, BuildWork build, JobTerms terms);

  std::size_t in_flight() const {
    const std::lock_guard lock(mutex_);
    return flights_.size();
  }
  std::uint64_t joined_total() const { return joined_total_.load(std::memory_order_relaxed); }

 private:
  struct Flight;
  class WaitGuard;
  using FlightPtr = std::shared_ptr<Flight>;

  void Launch(const FlightPtr& flight, const PoolJobPtr& job, BuildWork build);
  void RunFlight(const FlightPtr& flight, const BuildWork& build);
  void Fail(const FlightPtr& flight, const PoolJob* job, Error error);
  void Complete(const FlightPtr& flight, Result<Value> outcome, std::unique_lock<std::mutex> lock);
  void Forget(const FlightPtr& flight);  // mutex_ is held

  WorkerPool& pool_;
  mutable std::mutex mutex_;
  std::unordered_map<Key, FlightPtr, Hash> flights_;  // those that accept waiters
  std::atomic<std::uint64_t> joined_total_{0};
};

// SingleFlight::mutex_ guards everything except `stop` and const members.
template <typename Key, typename Value, typename Hash>
struct SingleFlight<Key, Value, Hash>::Flight {
  Flight(const Key& k, std::string n, std::stop_token cancelled)
      : key(k), name(std::move(n)), at_cancel(std::move(cancelled), [this] { stop.request_stop(); }) {}

  const Key key;
  const std::string name;
  std::stop_source stop;
  const std::stop_callback<std::function<void()>> at_cancel;
  bool begun = false;
  std::vector<std::weak_ptr<PoolJob>> jobs;  // one per client, until one of them runs; owned by the pool
  std::vector<WaiterPtr> waiters;
  std::optional<Result<Value>> outcome;
};

// One waiter's place in a flight. Its destruction may stop the flight and withdraw its jobs. It is a local object of
// Join, so that the place is released however the coroutine ends.
template <typename Key, typename Value, typename Hash>
class SingleFlight<Key, Value, Hash>::WaitGuard {
 public:
  WaitGuard(SingleFlight& owner, FlightPtr flight, WaiterPtr waiter)
      : owner_(owner), flight_(std::move(flight)), waiter_(std::move(waiter)) {}
  WaitGuard(const WaitGuard&) = delete;
  WaitGuard& operator=(const WaitGuard&) = delete;
  ~WaitGuard() {
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
asio::awaitable<typename SingleFlight<Key, Value, Hash>::FlightResult> SingleFlight<Key, Value, Hash>::Join(
    Key key, std::string name, BuildWork build, JobTerms terms) {
  const auto executor = co_await asio::this_coro::executor;
  const auto waiter = std::make_shared<asio::steady_timer>(executor, terms.deadline);
  auto job = std::make_shared<PoolJob>();
  job->terms = terms;
  std::unique_lock lock(mutex_);
  if (pool_.cancelled().stop_requested()) {
    co_return FlightResult(MakeError(ErrorCode::kCancelled, "the server is shutting down"), false);
  }
  const auto found = flights_.find(key);
  const bool joined = found != flights_.end();
  const FlightPtr flight = joined ? found->second : std::make_shared<Flight>(key, std::move(name), pool_.cancelled());
  const bool has_job = flight->begun || std::ranges::any_of(flight->jobs, [&](const auto& known) {
                         const PoolJobPtr waiting = known.lock();
                         return waiting && waiting->terms.client == terms.client;
                       });
  // Entered here, before the pool can drop another job of the flight: Fail must see that this one may still build.
  if (!has_job) flight->jobs.push_back(job);
  flight->waiters.push_back(waiter);
  if (!joined) flights_.emplace(key, flight);
  lock.unlock();
  const WaitGuard guard(*this, flight, waiter);
  if (joined) joined_total_.fetch_add(1, std::memory_order_relaxed);
  if (!has_job) Launch(flight, job, std::move(build));
  job = nullptr;  // the pool owns it

  boost::system::error_code ignored;  // finished, expired or cancelled; the outcome shows which
  co_await waiter->async_wait(asio::redirect_error(asio::use_awaitable, ignored));

  lock.lock();
  std::optional<Result<Value>> outcome = flight->outcome;
  lock.unlock();
  if (!outcome) {
    outcome = MakeError(ErrorCode::kCancelled, "{}: not ready before the request's deadline", flight->name);
  }
  co_return FlightResult(std::move(*outcome), joined);
}

// Submits a job that is in flight->jobs. To be called without mutex_: the pool may drop another flight's job, whose
// on_dropped takes mutex_.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Launch(const FlightPtr& flight, const PoolJobPtr& job, BuildWork build) {
  Result<void> submitted;
  try {
    job->run = [this, flight, build = std::move(build)] { RunFlight(flight, build); };
    job->on_dropped = [this, flight, self = job.get()] { Fail(flight, self, DroppedJobError(flight->name)); };
    submitted = pool_.Submit(job);
  } catch (const std::exception& thrown) {
    submitted = tl::unexpected(FailureOf(flight->name, thrown));
  }
  if (!submitted) Fail(flight, job.get(), std::move(submitted.error()));
}

// `job` will not run. The error is the outcome of the flight, unless another client's job can still build.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Fail(const FlightPtr& flight, const PoolJob* job, Error error) {
  std::unique_lock lock(mutex_);
  std::erase_if(flight->jobs, [job](const auto& known) { return known.expired() || known.lock().get() == job; });
  if (flight->begun || !flight->jobs.empty()) return;
  // Without unlocking: a client that joined now would lose its job.
  Complete(flight, tl::unexpected(std::move(error)), std::move(lock));
}

// On a worker thread.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::RunFlight(const FlightPtr& flight, const BuildWork& build) {
  std::vector<std::weak_ptr<PoolJob>> others;
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(flight->begun, true) || flight->outcome) return;  // another client's turn came before
    others.swap(flight->jobs);
  }
  for (const auto& job : others) pool_.Withdraw(job.lock());
  Result<Value> outcome = RunWork(flight->name, build, flight->stop.get_token());
  Complete(flight, std::move(outcome), std::unique_lock(mutex_));
}

// `lock` holds mutex_.
template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Complete(const FlightPtr& flight, Result<Value> outcome,
                                              std::unique_lock<std::mutex> lock) {
  flight->outcome = std::move(outcome);
  std::vector<WaiterPtr> waiters = std::exchange(flight->waiters, {});
  Forget(flight);
  lock.unlock();
  for (WaiterPtr& waiter : waiters) Wake(std::move(waiter));
}

template <typename Key, typename Value, typename Hash>
void SingleFlight<Key, Value, Hash>::Forget(const FlightPtr& flight) {
  const auto found = flights_.find(flight->key);
  if (found != flights_.end() && found->second == flight) flights_.erase(found);
}

}  // namespace terrace::server
