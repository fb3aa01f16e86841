#include "server/tiles/single_flight.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrace::server {
namespace {

std::string NameOf(const tiler::CacheKey& key) {
  return key.solo > 0 ? "work for one request" : "tile " + geo::ToString(key.request.key);
}

// Never throws: on a worker's thread that would be the end of the program.
Result<tiler::TilePtr> Outcome(const tiler::CacheKey& key, const SingleFlight::Build& build, std::stop_token stop) {
  try {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: stopped before it began", NameOf(key));
    return build(std::move(stop));
  } catch (const std::exception&) {
    return tl::unexpected(Error{ErrorCode::kUnavailable, "no memory"});  // for a longer message neither
  }
}

// A waiter is a timer that runs until the waiter's deadline and is cancelled when the flight lands.
using Waiter = std::shared_ptr<asio::steady_timer>;

// On the waiter's own thread, to which a timer belongs: nothing of it may be left here once it is posted there.
void Wake(Waiter waiter) {
  const auto executor = waiter->get_executor();
  const std::weak_ptr<asio::steady_timer> timer = std::exchange(waiter, nullptr);
  while (Waiter here = timer.lock()) {
    try {
      return asio::post(executor, [waiter = std::move(here)] { waiter->cancel(); });
    } catch (const std::exception&) {  // no memory; without waking it would wait to its deadline
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
}

}  // namespace

// Everything but `stop` is guarded by SingleFlight::mutex_.
struct SingleFlight::Flight {
  Clock::time_point deadline{};  // of the waiter that waits longest
  std::stop_source stop;
  bool begun = false;
  std::vector<std::weak_ptr<PoolJob>> jobs;  // one of each client, until one of them runs; the pool owns them
  std::vector<Waiter> waiters;
  std::optional<Result<tiler::TilePtr>> outcome;
};

// Holds one waiter's place; giving it back may stop the flight and withdraw its jobs. Lives in Join's frame, so that
// the place is given back however the coroutine ends.
class SingleFlight::Seat {
 public:
  Seat(SingleFlight& owner, tiler::CacheKey key, FlightPtr flight, Waiter waiter)
      : owner_(owner), key_(key), flight_(std::move(flight)), waiter_(std::move(waiter)) {}
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;
  ~Seat() {
    std::unique_lock lock(owner_.mutex_);
    std::erase(flight_->waiters, waiter_);
    if (!flight_->waiters.empty() || flight_->outcome) return;
    owner_.Forget(key_, flight_);
    const auto jobs = std::exchange(flight_->jobs, {});
    lock.unlock();  // stopping runs the builder's callbacks
    for (const auto& job : jobs) owner_.pool_.Withdraw(job.lock());
    flight_->stop.request_stop();
  }

 private:
  SingleFlight& owner_;
  const tiler::CacheKey key_;
  const FlightPtr flight_;
  const Waiter waiter_;
};

asio::awaitable<SingleFlight::Landing> SingleFlight::Join(tiler::CacheKey key, Build build, Clock::time_point deadline,
                                                          JobOrder order) {
  const auto executor = co_await asio::this_coro::executor;
  const auto waiter = std::make_shared<asio::steady_timer>(executor, deadline);
  std::unique_lock lock(mutex_);
  if (shut_down_) co_return Landing(MakeError(ErrorCode::kUnavailable, "the server is shutting down"), false);
  const auto found = flights_.find(key);
  const bool joined = found != flights_.end();
  const FlightPtr flight = joined ? found->second : std::make_shared<Flight>();
  flight->waiters.push_back(waiter);
  flight->deadline = std::max(flight->deadline, deadline);
  if (!joined) flights_.emplace(key, flight);
  const bool has_job = flight->begun || std::ranges::any_of(flight->jobs, [&](const auto& job) {
                         const PoolJobPtr waiting = job.lock();
                         return waiting && waiting->order.client == order.client;
                       });
  lock.unlock();
  const Seat seat(*this, key, flight, waiter);
  if (joined) joined_total_.fetch_add(1, std::memory_order_relaxed);
  order.deadline = deadline;
  if (!has_job) Launch(key, flight, std::move(build), order);

  boost::system::error_code ignored;  // landed, expired or cancelled: the outcome tells
  co_await waiter->async_wait(asio::redirect_error(asio::use_awaitable, ignored));

  lock.lock();
  std::optional<Result<tiler::TilePtr>> outcome = flight->outcome;
  lock.unlock();
  if (!outcome) outcome = MakeError(ErrorCode::kCancelled, "{}: not ready before the request's deadline", NameOf(key));
  co_return Landing(std::move(*outcome), joined);
}

// mutex_ is not held: the pool may displace another flight's job.
void SingleFlight::Launch(const tiler::CacheKey& key, const FlightPtr& flight, Build build, JobOrder order) {
  PoolJobPtr job;
  Result<void> submitted;
  try {
    job = std::make_shared<PoolJob>();
    job->order = order;
    job->run = [this, key, flight, build = std::move(build)] { Fly(key, flight, build); };
    job->displaced = [this, key, flight, self = job.get()] {
      Fail(key, flight, self, Error{ErrorCode::kOverloaded, NameOf(key) + ": displaced from the full queue of work"});
    };
    {
      const std::lock_guard lock(mutex_);
      flight->jobs.push_back(job);
    }
    submitted = pool_.Submit(job);
  } catch (const std::exception&) {
    submitted = tl::unexpected(Error{ErrorCode::kUnavailable, "no memory"});
  }
  if (!submitted) Fail(key, flight, job.get(), std::move(submitted.error()));
}

// `job` will not run. Those who wait share the failure unless another client's job is to build for them.
void SingleFlight::Fail(const tiler::CacheKey& key, const FlightPtr& flight, const PoolJob* job, Error error) {
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(flight->jobs, [job](const auto& known) { return known.expired() || known.lock().get() == job; });
    if (flight->begun || !flight->jobs.empty()) return;
  }
  Land(key, flight, tl::unexpected(std::move(error)));
}

// On a worker thread.
void SingleFlight::Fly(const tiler::CacheKey& key, const FlightPtr& flight, const Build& build) {
  std::vector<std::weak_ptr<PoolJob>> others;
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(flight->begun, true) || flight->outcome) return;  // another client's turn came before
    others.swap(flight->jobs);
  }
  for (const auto& job : others) pool_.Withdraw(job.lock());
  Land(key, flight, Outcome(key, build, flight->stop.get_token()));
}

void SingleFlight::Land(const tiler::CacheKey& key, const FlightPtr& flight, Result<tiler::TilePtr> outcome) {
  std::vector<Waiter> waiters;
  {
    const std::lock_guard lock(mutex_);
    flight->outcome = std::move(outcome);
    waiters.swap(flight->waiters);
    Forget(key, flight);
  }
  // The coroutine suspends in its wait before its thread runs anything else, so the cancellation always meets a wait.
  for (Waiter& waiter : waiters) Wake(std::move(waiter));
}

void SingleFlight::Forget(const tiler::CacheKey& key, const FlightPtr& flight) {
  const auto found = flights_.find(key);
  if (found != flights_.end() && found->second == flight) flights_.erase(found);
}

void SingleFlight::Shutdown() {
  decltype(flights_) stopped;
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
    stopped.swap(flights_);
  }
  for (const auto& [key, flight] : stopped) flight->stop.request_stop();
}

std::size_t SingleFlight::in_flight() const {
  const std::lock_guard lock(mutex_);
  return flights_.size();
}

}  // namespace terrace::server
