#include "server/jobs/worker_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>
#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <latch>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

PoolJobPtr JobOf(std::function<void()> run, JobTerms terms = {}) {
  auto job = std::make_shared<PoolJob>();
  job->run = std::move(run);
  job->terms = terms;
  return job;
}

// A pool whose threads are busy until Open, so that further jobs stay in the queue.
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
    job->on_dropped = [&] { ++displaced; };
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
  busy.Open();  // the clock of the test makes this a job of ten seconds
  ASSERT_TRUE(busy.pool.Submit(JobOf([&] {
    begun.set_value();
    is_open.wait();
  })));
  begun.get_future().wait();
  JobTerms patient{1}, hasty{1};
  patient.deadline = now() + 25s;
  int taken = 0;
  while (taken < 100 && busy.pool.Submit(JobOf([] {}, patient))) ++taken;
  EXPECT_EQ(taken, 3) << "the third would begin after 20 s, the fourth after 30";
  hasty.deadline = now() + 5s;
  EXPECT_FALSE(busy.pool.Submit(JobOf([] {}, hasty)));
  hasty.deadline = now();
  EXPECT_EQ(busy.pool.Submit(JobOf([] {}, hasty)).error().code, ErrorCode::kCancelled) << "not because of the queue";
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
  EXPECT_EQ(pool.Submit(JobOf([&] { ++done; })).error().code, ErrorCode::kCancelled) << "no source is unreadable";
}

// The result of Run in a coroutine on a separate thread; `leave` cancels the wait.
template <typename T>
std::future<Result<T>> RunAside(WorkerPool& pool, Work<T> work, std::chrono::milliseconds time = 10s,
                                asio::cancellation_slot leave = {}) {
  JobTerms terms;
  terms.deadline = JobClock::now() + time;
  const auto io = std::make_shared<asio::io_context>(1);
  auto ran =
      asio::co_spawn(*io, pool.Run<T>(std::move(work), terms), asio::bind_cancellation_slot(leave, asio::use_future));
  std::thread([io] { io->run(); }).detach();
  return ran;
}

TEST(WorkerPool, RunBringsTheWorksOwnResult) {
  WorkerPool pool(2, 100);
  EXPECT_EQ(RunAside<std::string>(pool, [](std::stop_token) -> Result<std::string> { return "done"; }).get(), "done");
  const auto failed = RunAside<int>(pool, [](std::stop_token) -> Result<int> {
                        return MakeError(ErrorCode::kChanged, "replaced");
                      }).get();
  EXPECT_EQ(failed.error().code, ErrorCode::kChanged);
  EXPECT_EQ(pool.runs(), 0u);
}

// kUnavailable would be a source that cannot be read.
TEST(WorkerPool, RunTellsAShortageOfMemoryFromOtherExceptions) {
  WorkerPool pool(1, 100);
  const auto short_of = RunAside<int>(pool, [](std::stop_token) -> Result<int> { throw std::bad_alloc(); }).get();
  EXPECT_EQ(short_of.error().code, ErrorCode::kOverloaded);
  EXPECT_EQ(short_of.error().message, "work for one request: no memory");
  const auto failed =
      RunAside<int>(pool, [](std::stop_token) -> Result<int> { throw std::out_of_range("index 7"); }).get();
  EXPECT_EQ(failed.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(failed.error().message, "work for one request: index 7");
  const auto changed = RunAside<int>(pool, [](std::stop_token) -> Result<int> {
                         throw ThrownError({ErrorCode::kChanged, "a.tif: was removed"});
                       }).get();
  EXPECT_EQ(changed.error().code, ErrorCode::kChanged) << "the server opens the sources again";
}

// Waits until it is asked to stop, at most ten seconds.
Work<bool> UntilStopped(std::promise<bool>& stopped) {
  return [&stopped](std::stop_token stop) -> Result<bool> {
    for (int i = 0; i < 2000 && !stop.stop_requested(); ++i) std::this_thread::sleep_for(5ms);
    stopped.set_value(stop.stop_requested());
    return stop.stop_requested();
  };
}

TEST(WorkerPool, RunStopsWorkWhoseDeadlineHasPassed) {
  WorkerPool pool(1, 100);
  std::promise<bool> stopped;
  EXPECT_EQ(RunAside(pool, UntilStopped(stopped), 500ms).get().error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(stopped.get_future().get());
}

TEST(WorkerPool, RunWithdrawsAndStopsForWhoLeaves) {
  WorkerPool pool(1, 100);
  std::promise<bool> stopped;
  std::promise<void> begun;
  asio::io_context io(1);
  asio::cancellation_signal leave, leave_second;
  JobTerms terms;
  terms.deadline = JobClock::now() + 10s;
  int ended = 0, ran = 0;
  const auto end = [&](std::exception_ptr, const auto&) { ++ended; };
  const Work<bool> first = [&, wait = UntilStopped(stopped)](std::stop_token stop) {
    begun.set_value();
    return wait(std::move(stop));
  };
  const Work<int> second = [&](std::stop_token) -> Result<int> { return ++ran; };
  asio::co_spawn(io, pool.Run<bool>(first, terms), asio::bind_cancellation_slot(leave.slot(), end));
  io.poll();
  begun.get_future().wait();
  asio::co_spawn(io, pool.Run<int>(second, terms), asio::bind_cancellation_slot(leave_second.slot(), end));
  io.restart();
  io.poll();
  EXPECT_EQ(pool.queued(), 1u);
  EXPECT_EQ(pool.runs(), 2u);
  leave_second.emit(asio::cancellation_type::terminal);
  io.restart();
  io.poll();
  EXPECT_EQ(pool.queued(), 0u) << "its job has left the queue";
  EXPECT_EQ(ended, 1);
  leave.emit(asio::cancellation_type::terminal);
  io.restart();
  io.run();
  EXPECT_TRUE(stopped.get_future().get());
  pool.Shutdown();
  EXPECT_EQ(ended, 2);
  EXPECT_EQ(ran, 0);
}

TEST(WorkerPool, CancelStopsWhatRunsAndRefusesWhatComes) {
  WorkerPool pool(2, 100);
  std::promise<bool> stopped;
  std::promise<void> begun;
  const Work<bool> work = [&, wait = UntilStopped(stopped)](std::stop_token stop) {
    begun.set_value();
    return wait(std::move(stop));
  };
  auto running = RunAside(pool, work);
  begun.get_future().wait();
  pool.Cancel();
  EXPECT_TRUE(stopped.get_future().get());
  running.wait();
  const auto late = RunAside<int>(pool, [](std::stop_token) -> Result<int> { return 1; }).get();
  EXPECT_EQ(late.error().code, ErrorCode::kCancelled);
}

TEST(WorkerPool, RunTellsWhomTheQueueDisplaces) {
  BusyPool busy(1, 1);
  const Work<int> nothing = [](std::stop_token) -> Result<int> { return 1; };
  asio::io_context io(1);
  std::vector<Result<int>> ends;
  JobTerms terms;
  terms.deadline = JobClock::now() + 10s;
  for (const std::uint64_t client : {7, 7, 8}) {
    terms.client = client;
    asio::co_spawn(io, busy.pool.Run<int>(nothing, terms),
                   [&](std::exception_ptr, Result<int> end) { ends.push_back(std::move(end)); });
    io.poll();
    io.restart();
  }
  ASSERT_FALSE(ends.empty());
  for (const Result<int>& end : ends) EXPECT_EQ(end.error().code, ErrorCode::kOverloaded);
  busy.Open();
  io.run();
  EXPECT_EQ(ends.size(), 3u);
}

TEST(WorkerPool, HasAThreadForEveryProcessorByDefault) { EXPECT_GE(WorkerPool(0, 1).threads(), 1u); }

}  // namespace
}  // namespace terrace::server
