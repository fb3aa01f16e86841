#include "server/tiles/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <latch>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrace::server {
namespace {

TEST(WorkerPool, RefusesWhenThreadsAndQueueAreFull) {
  WorkerPool pool(2, 3);
  std::promise<void> gate;
  const std::shared_future<void> open = gate.get_future().share();
  std::latch running(2);
  std::atomic<int> done{0};
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(pool.TrySubmit([&, open] {
      running.count_down();
      open.wait();
      ++done;
    }));
  }
  running.wait();
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(pool.TrySubmit([&] { ++done; }));
  EXPECT_FALSE(pool.TrySubmit([&] { ++done; }));
  EXPECT_EQ(pool.queued(), 3u);
  gate.set_value();
  pool.Shutdown();
  EXPECT_EQ(done, 5);
}

TEST(WorkerPool, TakesAsManyJobsAsThreadsWithoutAQueue) {
  WorkerPool pool(2, 0);
  std::promise<void> gate;
  const std::shared_future<void> open = gate.get_future().share();
  EXPECT_TRUE(pool.TrySubmit([open] { open.wait(); }));
  EXPECT_TRUE(pool.TrySubmit([open] { open.wait(); }));
  EXPECT_FALSE(pool.TrySubmit([] {}));
  gate.set_value();
}

TEST(WorkerPool, RunsWhatItTookAndTakesNothingAfterShutdown) {
  WorkerPool pool(1, 100);
  std::atomic<int> done{0};
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(pool.TrySubmit([&] { ++done; }));
  pool.Shutdown();
  EXPECT_EQ(done, 50);
  EXPECT_FALSE(pool.TrySubmit([&] { ++done; }));
}

TEST(WorkerPool, HasAThreadForEveryProcessorByDefault) { EXPECT_GE(WorkerPool(0, 1).threads(), 1u); }

// A pool of one thread that is busy until `open`; what waits behind it is in the queue.
struct BusyPool {
  explicit BusyPool(std::size_t queue_length) : pool(1, queue_length) {
    std::promise<void> begun;
    EXPECT_TRUE(pool.TrySubmit([&begun, open = open.get_future().share()] {
      begun.set_value();
      open.wait();
    }));
    begun.get_future().wait();
  }
  // `name` is written to `order` when its turn comes.
  bool Submit(const std::string& name, JobOrder job_order) {
    return pool.TrySubmit([this, name] { order.push_back(name); }, job_order);
  }
  ~BusyPool() { Open(); }
  std::vector<std::string> Run() {
    Open();
    pool.Shutdown();
    return order;
  }
  void Open() {
    if (!std::exchange(is_open, true)) open.set_value();
  }

  std::promise<void> open;
  bool is_open = false;
  std::vector<std::string> order;
  WorkerPool pool;  // ends before what its jobs write to
};

TEST(WorkerPool, ClientsTakeTurnsAndShallowTilesGoFirst) {
  BusyPool busy(100);
  for (const int level : {9, 5, 9, 2}) ASSERT_TRUE(busy.Submit("a" + std::to_string(level), {1, level}));
  for (const int level : {7, 3}) ASSERT_TRUE(busy.Submit("b" + std::to_string(level), {2, level}));
  ASSERT_TRUE(busy.Submit("c", {3, 20}));
  EXPECT_EQ(busy.pool.queued(), 7u);
  EXPECT_EQ(busy.Run(), (std::vector<std::string>{"a2", "b3", "c", "a5", "b7", "a9", "a9"}));
}

TEST(WorkerPool, ADeepTileThatHasWaitedGoesBeforeShallowOnesThatCome) {
  BusyPool busy(100);
  ASSERT_TRUE(busy.Submit("deep", {1, 2}));
  std::this_thread::sleep_for(std::chrono::milliseconds(250));  // two levels are 200 ms
  ASSERT_TRUE(busy.Submit("shallow", {1, 0}));
  EXPECT_EQ(busy.Run(), (std::vector<std::string>{"deep", "shallow"}));
}

TEST(WorkerPool, OneClientLeavesPlacesForOthers) {
  BusyPool busy(90);
  int first = 0, second = 0, third = 0;
  while (busy.Submit("1", {1, 0})) ++first;
  while (busy.Submit("2", {2, 0})) ++second;
  while (busy.Submit("3", {3, 0})) ++third;
  EXPECT_EQ(first, 61) << "the last one found sixty waiting, and thirty places";
  EXPECT_EQ(second, 20);
  EXPECT_EQ(third, 7);
  const std::vector<std::string> order = busy.Run();
  EXPECT_EQ(std::vector<std::string>(order.begin(), order.begin() + 3), (std::vector<std::string>{"1", "2", "3"}));
}

}  // namespace
}  // namespace terrace::server
