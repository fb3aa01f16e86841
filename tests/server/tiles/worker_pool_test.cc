#include "server/tiles/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <latch>

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

}  // namespace
}  // namespace terrace::server
