#include "server/tiles/single_flight.h"

#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <exception>
#include <future>
#include <latch>
#include <thread>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

TilePtr SomeTile() { return std::make_shared<const EncodedTile>(); }

// Waits until `stop` is requested, at most ten seconds.
bool StopComes(const std::stop_token& stop) {
  for (int i = 0; i < 2000 && !stop.stop_requested(); ++i) std::this_thread::sleep_for(5ms);
  return stop.stop_requested();
}

class SingleFlightTest : public testing::Test {
 protected:
  void TearDown() override { pool_.Shutdown(); }  // its jobs refer to the flights

  void Join(SingleFlight::Build build, SingleFlight::Clock::time_point deadline,
            asio::cancellation_slot slot = asio::cancellation_slot()) {
    auto keep = [this](std::exception_ptr, SingleFlight::Landing landing) { landings_.push_back(std::move(landing)); };
    asio::co_spawn(io_, flights_.Join(CacheKey(), std::move(build), deadline),
                   asio::bind_cancellation_slot(slot, keep));
  }
  static SingleFlight::Clock::time_point Soon() { return SingleFlight::Clock::now() + 10s; }

  WorkerPool pool_{2, 4};
  SingleFlight flights_{pool_};
  asio::io_context io_{1};
  std::vector<SingleFlight::Landing> landings_;
};

TEST_F(SingleFlightTest, BuildsOnceForTwoHundred) {
  std::atomic<int> builds{0};
  std::promise<void> gate;
  const std::shared_future<void> open = gate.get_future().share();
  for (int i = 0; i < 200; ++i) {
    Join(
        [&builds, open](std::stop_token) -> Result<TilePtr> {
          ++builds;
          open.wait();
          return SomeTile();
        },
        Soon());
  }
  asio::post(io_, [&gate] { gate.set_value(); });
  io_.run();
  EXPECT_EQ(builds, 1);
  ASSERT_EQ(landings_.size(), 200u);
  int starters = 0;
  for (const auto& landing : landings_) {
    ASSERT_TRUE(landing.tile);
    EXPECT_EQ(*landing.tile, *landings_[0].tile);
    starters += !landing.joined;
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
        [open](std::stop_token) -> Result<TilePtr> {
          open.wait();
          return MakeError(ErrorCode::kUnavailable, "the disk is gone");
        },
        Soon());
  }
  asio::post(io_, [&gate] { gate.set_value(); });
  io_.run();
  ASSERT_EQ(landings_.size(), 5u);
  for (const auto& landing : landings_) {
    ASSERT_FALSE(landing.tile);
    EXPECT_EQ(landing.tile.error().code, ErrorCode::kUnavailable);
  }
  io_.restart();
  Join([](std::stop_token) -> Result<TilePtr> { return SomeTile(); }, Soon());
  io_.run();
  EXPECT_TRUE(landings_.back().tile);
}

TEST_F(SingleFlightTest, StopsWhenTheLastWaiterLeaves) {
  std::promise<bool> stopped;
  std::latch begun(1);
  const auto build = [&](std::stop_token stop) -> Result<TilePtr> {
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

TEST_F(SingleFlightTest, StopsAtItsDeadline) {
  std::promise<bool> stopped;
  Join(
      [&](std::stop_token stop) -> Result<TilePtr> {
        stopped.set_value(StopComes(stop));
        return MakeError(ErrorCode::kCancelled, "stopped");
      },
      SingleFlight::Clock::now() + 50ms);
  // A passenger with more time does not keep it in the air.
  Join([](std::stop_token) -> Result<TilePtr> { return SomeTile(); }, Soon());
  io_.run();
  ASSERT_EQ(landings_.size(), 2u);
  for (const auto& landing : landings_) EXPECT_EQ(landing.tile.error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(stopped.get_future().get());
}

TEST_F(SingleFlightTest, StopsEverythingAtShutdown) {
  std::latch begun(1);
  Join(
      [&](std::stop_token stop) -> Result<TilePtr> {
        begun.count_down();
        StopComes(stop);
        return MakeError(ErrorCode::kCancelled, "stopped");
      },
      Soon());
  asio::post(io_, [&] {
    begun.wait();
    flights_.Shutdown();
  });
  io_.run();
  ASSERT_EQ(landings_.size(), 1u);
  EXPECT_EQ(landings_[0].tile.error().code, ErrorCode::kCancelled);
  io_.restart();
  Join([](std::stop_token) -> Result<TilePtr> { return SomeTile(); }, Soon());
  io_.run();
  EXPECT_EQ(landings_[1].tile.error().code, ErrorCode::kUnavailable);
}

TEST_F(SingleFlightTest, RefusesWhatThePoolRefuses) {
  pool_.Shutdown();
  Join([](std::stop_token) -> Result<TilePtr> { return SomeTile(); }, Soon());
  io_.run();
  ASSERT_EQ(landings_.size(), 1u);
  EXPECT_EQ(landings_[0].tile.error().code, ErrorCode::kOverloaded);
  EXPECT_EQ(flights_.in_flight(), 0u);
}

}  // namespace
}  // namespace terrace::server
