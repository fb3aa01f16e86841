#include "server/tiles/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <latch>
#include <memory>
#include <utility>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

PoolJobPtr JobOf(std::function<void()> run, JobOrder order = {}) {
  auto job = std::make_shared<PoolJob>();
  job->run = std::move(run);
  job->order = order;
  return job;
}

// A pool whose threads are busy until Open; what waits behind them is in the queue.
struct BusyPool {
  BusyPool(unsigned threads, std::size_t queue_length, WorkerPool::Now now = JobClock::now)
      : pool(threads, queue_length, std::move(now)) {
    std::latch begun(threads);
    for (unsigned i = 0; i < threads; ++i) {
      EXPECT_TRUE(pool.Submit(JobOf([&begun, open = is_open] {
        begun.count_down();
        open.wait();
      })));
    }
    begun.wait();
  }
  ~BusyPool() { Open(); }
  void Open() {
    if (!std::exchange(opened, true)) open.set_value();
  }

  std::promise<void> open;
  const std::shared_future<void> is_open = open.get_future().share();
  bool opened = false;
  WorkerPool pool;
};

TEST(WorkerPool, FourHundredAndEightyJobsOfOneClientWait) {
  BusyPool busy(2, 10'000);
  std::atomic<int> done{0};
  for (int i = 0; i < 480; ++i) ASSERT_TRUE(busy.pool.Submit(JobOf([&] { ++done; }, {1, i % 15})));
  EXPECT_EQ(busy.pool.queued(), 480u);
  busy.Open();
  busy.pool.Shutdown();
  EXPECT_EQ(done, 480);
}

TEST(WorkerPool, TheNewestJobOfWhoHasMostGoesAtTheBound) {
  BusyPool busy(2, 3);
  std::atomic<int> done{0}, displaced{0};
  for (int i = 0; i < 3; ++i) {
    const PoolJobPtr job = JobOf([&] { ++done; }, {1});
    job->displaced = [&] { ++displaced; };
    EXPECT_TRUE(busy.pool.Submit(job));
  }
  const Result<void> refused = busy.pool.Submit(JobOf([&] { ++done; }, {1}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kOverloaded);
  EXPECT_EQ(displaced, 0) << "its own is the newest";
  EXPECT_TRUE(busy.pool.Submit(JobOf([&] { ++done; }, {2})));
  EXPECT_EQ(displaced, 1);
  EXPECT_EQ(busy.pool.queued(), 3u);
  busy.Open();
  busy.pool.Shutdown();
  EXPECT_EQ(done, 3);
}

TEST(WorkerPool, TakesAsManyJobsAsThreadsWithoutAQueue) {
  BusyPool busy(2, 0);
  EXPECT_FALSE(busy.pool.Submit(JobOf([] {})));
}

TEST(WorkerPool, RefusesOnlyWhatCannotBeginInTime) {
  std::promise<void> open, begun;
  const std::shared_future<void> is_open = open.get_future().share();
  std::atomic<std::int64_t> seconds{0};
  const auto now = [&] { return JobClock::time_point(1h) + std::chrono::seconds(seconds); };
  BusyPool busy(1, 10'000, now);
  seconds = 10;
  busy.Open();  // a job of ten seconds, as it seems
  ASSERT_TRUE(busy.pool.Submit(JobOf([&] {
    begun.set_value();
    is_open.wait();
  })));
  begun.get_future().wait();
  JobOrder patient{1}, hasty{1};
  patient.deadline = now() + 25s;
  int taken = 0;
  while (taken < 100 && busy.pool.Submit(JobOf([] {}, patient))) ++taken;
  EXPECT_EQ(taken, 3) << "the third would begin after 20 s, the fourth after 30";
  hasty.deadline = now() + 5s;
  EXPECT_FALSE(busy.pool.Submit(JobOf([] {}, hasty)));
  hasty.client = 2;
  hasty.deadline = now() + 15s;
  EXPECT_TRUE(busy.pool.Submit(JobOf([] {}, hasty))) << "its turn comes after one of the other's";
  open.set_value();
}

TEST(WorkerPool, WhatIsWithdrawnDoesNotRun) {
  BusyPool busy(1, 10'000);
  std::atomic<int> done{0};
  std::vector<PoolJobPtr> jobs;
  for (int i = 0; i < 240; ++i) {
    jobs.push_back(JobOf([&] { ++done; }, {1, i % 15, i % 2 == 0}));
    ASSERT_TRUE(busy.pool.Submit(jobs.back()));
  }
  for (const PoolJobPtr& job : jobs) busy.pool.Withdraw(job);
  EXPECT_EQ(busy.pool.queued(), 0u);
  busy.Open();
  busy.pool.Shutdown();
  EXPECT_EQ(done, 0);
}

TEST(WorkerPool, RunsWhatItTookAndTakesNothingAfterShutdown) {
  WorkerPool pool(2, 100);
  std::atomic<int> done{0};
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(pool.Submit(JobOf([&] { ++done; }, {1, 0, i % 2 == 0})));
  pool.Shutdown();
  EXPECT_EQ(done, 50);
  EXPECT_EQ(pool.Submit(JobOf([&] { ++done; })).error().code, ErrorCode::kUnavailable);
}

TEST(WorkerPool, HasAThreadForEveryProcessorByDefault) { EXPECT_GE(WorkerPool(0, 1).threads(), 1u); }

}  // namespace
}  // namespace terrace::server
