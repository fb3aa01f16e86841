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

std::string NameOf(const CacheKey& key) {
  return key.solo > 0 ? "work for one request" : "tile " + geo::ToString(key.request.key);
}

// Never throws: on a worker's thread that would be the end of the program.
Result<TilePtr> Outcome(const CacheKey& key, const SingleFlight::Build& build, std::stop_token stop) {
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
  explicit Flight(Clock::time_point d) : deadline(d) {}

  const Clock::time_point deadline;
  std::stop_source stop;
  std::vector<Waiter> waiters;
  std::optional<Result<TilePtr>> outcome;
};

// Holds one waiter's place; giving it back may stop the flight. Lives in Join's frame, so that the place is given back
// however the coroutine ends.
class SingleFlight::Seat {
 public:
  Seat(SingleFlight& owner, CacheKey key, std::shared_ptr<Flight> flight, Waiter waiter)
      : owner_(owner), key_(key), flight_(std::move(flight)), waiter_(std::move(waiter)) {}
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;
  ~Seat() {
    std::unique_lock lock(owner_.mutex_);
    std::erase(flight_->waiters, waiter_);
    if (!flight_->waiters.empty() || flight_->outcome) return;
    owner_.Forget(key_, flight_);
    lock.unlock();  // stopping runs the builder's callbacks
    flight_->stop.request_stop();
  }

 private:
  SingleFlight& owner_;
  const CacheKey key_;
  const std::shared_ptr<Flight> flight_;
  const Waiter waiter_;
};

asio::awaitable<SingleFlight::Landing> SingleFlight::Join(CacheKey key, Build build, Clock::time_point deadline,
                                                          JobOrder order) {
  const auto executor = co_await asio::this_coro::executor;
  const auto waiter = std::make_shared<asio::steady_timer>(executor);
  std::unique_lock lock(mutex_);
  bool joined = false;
  const Result<std::shared_ptr<Flight>> boarded = Board(key, std::move(build), deadline, order, &joined);
  if (!boarded) co_return Landing(tl::unexpected(boarded.error()), joined);
  const std::shared_ptr<Flight> flight = *boarded;
  flight->waiters.push_back(waiter);
  lock.unlock();
  const Seat seat(*this, key, flight, waiter);

  // Nobody waits past the flight's deadline, so then its last waiter leaves, and it stops.
  waiter->expires_at(std::min(deadline, flight->deadline));
  boost::system::error_code ignored;  // landed, expired or cancelled: the outcome tells
  co_await waiter->async_wait(asio::redirect_error(asio::use_awaitable, ignored));

  lock.lock();
  std::optional<Result<TilePtr>> outcome = flight->outcome;
  lock.unlock();
  if (!outcome) outcome = MakeError(ErrorCode::kCancelled, "{}: not ready before the request's deadline", NameOf(key));
  co_return Landing(std::move(*outcome), joined);
}

// Finds the flight of `key` or starts one. mutex_ is held, so that nobody can board a flight the pool refused.
Result<std::shared_ptr<SingleFlight::Flight>> SingleFlight::Board(const CacheKey& key, Build build,
                                                                  Clock::time_point deadline, JobOrder order,
                                                                  bool* joined) {
  if (shut_down_) return MakeError(ErrorCode::kUnavailable, "the server is shutting down");
  if (const auto found = flights_.find(key); found != flights_.end()) {
    *joined = true;
    joined_total_.fetch_add(1, std::memory_order_relaxed);
    return found->second;
  }
  auto flight = std::make_shared<Flight>(deadline);
  auto job = [this, key, flight, build = std::move(build)] { Fly(key, flight, build); };
  if (!pool_.TrySubmit(std::move(job), order)) {
    return MakeError(ErrorCode::kOverloaded, "{}: the queue of builds is full", NameOf(key));
  }
  flights_.emplace(key, flight);
  return flight;
}

// On a worker thread.
void SingleFlight::Fly(const CacheKey& key, const std::shared_ptr<Flight>& flight, const Build& build) {
  Result<TilePtr> outcome = Outcome(key, build, flight->stop.get_token());

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

void SingleFlight::Forget(const CacheKey& key, const std::shared_ptr<Flight>& flight) {
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
