#include "server/jobs/single_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <exception>
#include <future>
#include <latch>
#include <mutex>
#include <thread>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

using Value = std::shared_ptr<const int>;
using Flights = SingleFlight<std::size_t, Value>;

Value SomeValue() { return std::make_shared<const int>(7); }

JobTerms Until(JobClock::time_point deadline, std::uint64_t client = 0, int level = 0) {
  JobTerms terms;
  terms.client = client;
  terms.level = level;
  terms.deadline = deadline;
  return terms;
}

// Waits until `stop` is requested, for at most ten seconds.
bool StopComes(const std::stop_token& stop) {
  for (int i = 0; i < 2000 && !stop.stop_requested(); ++i) std::this_thread::sleep_for(5ms);
  return stop.stop_requested();
}

class SingleFlightTest : public testing::Test {
 protected:
  explicit SingleFlightTest(unsigned threads = 2, std::size_t queue_length = 10'000) : pool_(threads, queue_length) {}
  void TearDown() override { pool_.Shutdown(); }  // its jobs refer to the flights

  void Join(Flights::BuildWork build, JobClock::time_point deadline,
            asio::cancellation_slot slot = asio::cancellation_slot()) {
    auto keep = [this](std::exception_ptr, Flights::FlightResult flight) {
      flights_done_.push_back(std::move(flight));
    };
    asio::co_spawn(io_, flights_.Join(0, "it", std::move(build), Until(deadline)),
                   asio::bind_cancellation_slot(slot, keep));
  }
  void JoinAs(std::size_t key, JobTerms terms, Flights::BuildWork build,
              asio::cancellation_slot slot = asio::cancellation_slot()) {
    auto keep = [this](std::exception_ptr, Flights::FlightResult flight) {
      flights_done_.push_back(std::move(flight));
    };
    asio::co_spawn(io_, flights_.Join(key, "it", std::move(build), terms), asio::bind_cancellation_slot(slot, keep));
  }
  // Blocks the workers with jobs of the first client.
  void HoldWorkers(const std::shared_future<void>& open) {
    std::latch begun(pool_.threads());
    for (unsigned i = 0; i < pool_.threads(); ++i) {
      auto job = std::make_shared<PoolJob>();
      job->terms.client = 1;
      job->run = [&begun, open] {
        begun.count_down();
        open.wait();
      };
      ASSERT_TRUE(pool_.Submit(job));
    }
    begun.wait();
  }
  static std::shared_future<void> GateOf(std::promise<void>& gate) { return gate.get_future().share(); }
  static JobClock::time_point Soon() { return JobClock::now() + 10s; }

  WorkerPool pool_;
  Flights flights_{pool_};
  asio::io_context io_{1};
  std::vector<Flights::FlightResult> flights_done_;
};

// With one worker, builds run in the order of the queue.
class SingleFlightOfOneWorker : public SingleFlightTest {
 protected:
  SingleFlightOfOneWorker() : SingleFlightTest(1) {}
};

class SingleFlightOfShortQueue : public SingleFlightTest {
 protected:
  SingleFlightOfShortQueue() : SingleFlightTest(1, 3) {}
};

TEST_F(SingleFlightTest, BuildsOnceForTwoHundred) {
  std::atomic<int> builds{0};
  std::promise<void> gate;
  const std::shared_future<void> open = gate.get_future().share();
  for (int i = 0; i < 200; ++i) {
    Join(
        [&builds, open](std::stop_token) -> Result<Value> {
          ++builds;
          open.wait();
          return SomeValue();
        },
        Soon());
  }
  asio::post(io_, [&gate] { gate.set_value(); });
  io_.run();
  EXPECT_EQ(builds, 1);
  ASSERT_EQ(flights_done_.size(), 200u);
  int starters = 0;
  for (const auto& flight : flights_done_) {
    ASSERT_TRUE(flight.value);
    EXPECT_EQ(*flight.value, *flights_done_[0].value);
    starters += !flight.joined;
  }
  EXPECT_EQ(starters, 1);
  EXPECT_EQ(flights_.joined_total(), 199u);
  EXPECT_EQ(flights_.in_flight(), 0u);
}

TEST_F(SingleFlightTest, GivesAFailureToAllAndForgetsIt) {
  std::promise<void> gate;
  const std::shared_future<void> open = gate.get_future().share();
  for (int i = 0; i < 5; ++i) {
    Join(
        [open](std::stop_token) -> Result<Value> {
          open.wait();
          return MakeError(ErrorCode::kUnavailable, "the disk is gone");
        },
        Soon());
  }
  asio::post(io_, [&gate] { gate.set_value(); });
  io_.run();
  ASSERT_EQ(flights_done_.size(), 5u);
  for (const auto& flight : flights_done_) {
    ASSERT_FALSE(flight.value);
    EXPECT_EQ(flight.value.error().code, ErrorCode::kUnavailable);
  }
  io_.restart();
  Join([](std::stop_token) -> Result<Value> { return SomeValue(); }, Soon());
  io_.run();
  EXPECT_TRUE(flights_done_.back().value);
}

TEST_F(SingleFlightTest, StopsWhenTheLastWaiterLeaves) {
  std::promise<bool> stopped;
  std::latch begun(1);
  const auto build = [&](std::stop_token stop) -> Result<Value> {
    begun.count_down();
    stopped.set_value(StopComes(stop));
    return MakeError(ErrorCode::kCancelled, "stopped");
  };
  asio::cancellation_signal first, second;
  Join(build, Soon(), first.slot());
  Join(build, Soon(), second.slot());
  asio::post(io_, [&] {
    begun.wait();
    first.emit(asio::cancellation_type::terminal);
  });
  io_.run_for(100ms);
  EXPECT_EQ(flights_.in_flight(), 1u) << "one waiter is left";
  second.emit(asio::cancellation_type::terminal);
  io_.restart();
  io_.run();
  EXPECT_EQ(flights_.in_flight(), 0u);
  EXPECT_TRUE(stopped.get_future().get());
}

TEST_F(SingleFlightTest, StopsAtTheDeadlineOfWhoWaitsLongest) {
  std::promise<bool> stopped;
  Join(
      [&](std::stop_token stop) -> Result<Value> {
        stopped.set_value(StopComes(stop));
        return MakeError(ErrorCode::kCancelled, "stopped");
      },
      JobClock::now() + 50ms);
  Join([](std::stop_token) -> Result<Value> { return SomeValue(); }, JobClock::now() + 80ms);
  io_.run();
  ASSERT_EQ(flights_done_.size(), 2u);
  for (const auto& flight : flights_done_) EXPECT_EQ(flight.value.error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(stopped.get_future().get());
}

TEST_F(SingleFlightTest, ALateJoinerHasItsWholeDeadline) {
  std::promise<void> gate;
  const auto build = [open = gate.get_future().share()](std::stop_token stop) -> Result<Value> {
    open.wait();
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    return SomeValue();
  };
  Join(build, JobClock::now() + 50ms);
  Join(build, JobClock::now() + 1h);
  while (flights_done_.empty()) io_.run_one();  // the first gives up
  EXPECT_EQ(flights_done_[0].value.error().code, ErrorCode::kCancelled);
  gate.set_value();
  io_.run();
  ASSERT_EQ(flights_done_.size(), 2u);
  EXPECT_TRUE(flights_done_[1].joined);
  EXPECT_TRUE(flights_done_[1].value) << "the deadline is not the first one's";
}

TEST_F(SingleFlightTest, WhoLeavesTakesItsJobOutOfTheQueue) {
  std::promise<void> gate;
  std::atomic<int> builds{0};
  HoldWorkers(GateOf(gate));
  std::vector<asio::cancellation_signal> leave(240);
  for (std::size_t i = 0; i < leave.size(); ++i) {
    JoinAs(
        i, Until(Soon(), i % 7 + 1, static_cast<int>(i % 15)),
        [&](std::stop_token) -> Result<Value> {
          ++builds;
          return SomeValue();
        },
        leave[i].slot());
  }
  io_.poll();
  EXPECT_EQ(pool_.queued(), 240u);
  for (auto& signal : leave) signal.emit(asio::cancellation_type::terminal);
  io_.restart();
  io_.run();
  EXPECT_EQ(pool_.queued(), 0u);
  EXPECT_EQ(flights_.in_flight(), 0u);
  gate.set_value();
  pool_.Shutdown();
  EXPECT_EQ(builds, 0);
}

TEST_F(SingleFlightOfOneWorker, WhoJoinsWaitsInItsOwnTurn) {
  std::promise<void> gate;
  HoldWorkers(GateOf(gate));
  std::mutex mutex;
  std::vector<std::size_t> built;
  const auto note = [&](std::size_t i) {
    return [&, i](std::stop_token) -> Result<Value> {
      const std::lock_guard lock(mutex);
      built.push_back(i);
      return SomeValue();
    };
  };
  for (std::size_t i = 0; i < 100; ++i) JoinAs(i, Until(Soon(), 1), note(i));
  JoinAs(99, Until(Soon(), 2), note(99));
  io_.poll();
  EXPECT_EQ(pool_.queued(), 101u);
  gate.set_value();
  io_.restart();
  io_.run();
  ASSERT_EQ(built.size(), 100u) << "once each";
  EXPECT_EQ(built.front(), 99u) << "the second client is served next";
  EXPECT_EQ(pool_.queued(), 0u);
}

TEST_F(SingleFlightTest, TellsWhomTheQueueDisplaces) {
  WorkerPool small(1, 1);
  Flights flights(small);
  std::promise<void> gate;
  const auto wait = [open = GateOf(gate)](std::stop_token) -> Result<Value> {
    open.wait();
    return SomeValue();
  };
  std::vector<Result<Value>> ends;
  const auto join = [&](std::size_t i, std::uint64_t client) {
    asio::co_spawn(io_, flights.Join(i, "it", wait, Until(Soon(), client)),
                   [&](std::exception_ptr, Flights::FlightResult flight) { ends.push_back(std::move(flight.value)); });
    io_.poll();
    io_.restart();
  };
  join(0, 1);
  while (small.queued() > 0) std::this_thread::yield();
  join(1, 1);
  join(2, 1);
  ASSERT_EQ(ends.size(), 1u) << "the newest of the one client";
  EXPECT_EQ(ends[0].error().code, ErrorCode::kOverloaded);
  join(3, 2);
  io_.poll();
  gate.set_value();
  io_.restart();
  io_.run();
  small.Shutdown();
  ASSERT_EQ(ends.size(), 4u);
}

// The queue always has room for who joins, because the client before it has more jobs.
TEST_F(SingleFlightOfShortQueue, WhoJoinsWhileTheFirstJobIsDroppedStillBuilds) {
  asio::io_context other(1);
  const auto build = [](std::stop_token) -> Result<Value> { return SomeValue(); };
  for (int round = 0; round < 1000; ++round) {
    std::promise<void> gate;
    HoldWorkers(GateOf(gate));
    for (std::size_t key = 0; key < 3; ++key) JoinAs(key, Until(Soon(), 2), build);
    io_.poll();
    JoinAs(3, Until(Soon(), 4), build);  // displaces the job of key 2
    Result<Value> joined = MakeError(ErrorCode::kCancelled, "not done");
    asio::co_spawn(other, flights_.Join(2, "it", build, Until(Soon(), 3)),
                   [&](std::exception_ptr, Flights::FlightResult flight) { joined = std::move(flight.value); });
    std::atomic<bool> is_there{false};
    std::jthread thread([&] {
      is_there = true;
      other.poll();
    });
    while (!is_there) std::this_thread::yield();
    for (volatile int wait = round % 200; wait > 0;) wait = wait - 1;  // meets the other thread at each of its steps
    io_.poll();
    thread.join();
    gate.set_value();
    io_.run();
    other.run();
    ASSERT_TRUE(joined) << joined.error().message << " in round " << round;
    io_.restart();
    other.restart();
  }
}

TEST_F(SingleFlightTest, StopsEverythingAtShutdown) {
  std::latch begun(1);
  Join(
      [&](std::stop_token stop) -> Result<Value> {
        begun.count_down();
        StopComes(stop);
        return MakeError(ErrorCode::kCancelled, "stopped");
      },
      Soon());
  asio::post(io_, [&] {
    begun.wait();
    pool_.Cancel();
  });
  io_.run();
  ASSERT_EQ(flights_done_.size(), 1u);
  EXPECT_EQ(flights_done_[0].value.error().code, ErrorCode::kCancelled);
  io_.restart();
  Join([](std::stop_token) -> Result<Value> { return SomeValue(); }, Soon());
  io_.run();
  EXPECT_EQ(flights_done_[1].value.error().code, ErrorCode::kCancelled);
}

TEST_F(SingleFlightTest, RefusesWhatThePoolRefuses) {
  pool_.Shutdown();
  Join([](std::stop_token) -> Result<Value> { return SomeValue(); }, Soon());
  io_.run();
  ASSERT_EQ(flights_done_.size(), 1u);
  EXPECT_EQ(flights_done_[0].value.error().code, ErrorCode::kCancelled);
  EXPECT_EQ(flights_.in_flight(), 0u);
}

}  // namespace
}  // namespace terrace::server
