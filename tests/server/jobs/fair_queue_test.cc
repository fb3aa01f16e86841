#include "server/jobs/fair_queue.h"

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class FairQueueTest : public testing::Test {
 protected:
  PoolJobPtr Push(FairQueue& queue, std::uint64_t client, int level = 0, bool is_long = false, std::uint64_t kind = 0) {
    auto job = std::make_shared<PoolJob>();
    job->terms.client = client;
    job->terms.level = level;
    job->terms.is_long = is_long;
    job->terms.kind = kind;
    queue.Push(job, now_);
    return job;
  }
  // One thread runs the next job for `time`. Returns the client of the job, 0 if there is none.
  std::uint64_t Serve(FairQueue& queue, std::chrono::milliseconds time) {
    const PoolJobPtr job = queue.Take(now_);
    if (!job) return 0;
    now_ += time;
    queue.Finish(job, now_);
    return job->terms.client;
  }

  JobClock::time_point now_{1h};
};

TEST_F(FairQueueTest, ClientsTakeTurnsAndShallowTilesGoFirst) {
  FairQueue queue(1);
  for (const int level : {9, 5, 9, 2}) Push(queue, 1, level);
  for (const int level : {7, 3}) Push(queue, 2, level);
  Push(queue, 3, 20);
  std::vector<std::string> order;
  while (const PoolJobPtr job = queue.Take(now_)) {
    order.push_back(std::to_string(job->terms.client) + ":" + std::to_string(job->terms.level));
    now_ += 10ms;
    queue.Finish(job, now_);
  }
  EXPECT_EQ(order, (std::vector<std::string>{"1:2", "2:3", "3:20", "1:5", "2:7", "1:9", "1:9"}));
}

TEST_F(FairQueueTest, ADeepTileThatHasWaitedGoesBeforeShallowOnesThatCome) {
  FairQueue queue(1);
  Push(queue, 1, 2);
  now_ += 250ms;
  Push(queue, 1, 0);
  EXPECT_EQ(queue.Take(now_)->terms.level, 2);
}

TEST_F(FairQueueTest, WhoAsksOnceIsNextHoweverManyJobsAnotherHas) {
  FairQueue queue(2);
  for (int i = 0; i < 1000; ++i) Push(queue, 1);
  const PoolJobPtr first = queue.Take(now_), second = queue.Take(now_);
  now_ += 50ms;
  Push(queue, 2, 30);
  queue.Finish(first, now_);
  EXPECT_EQ(queue.Take(now_)->terms.client, 2u);
}

TEST_F(FairQueueTest, TimeCountsAndNotTheNumberOfJobs) {
  FairQueue queue(1);
  std::map<std::uint64_t, std::chrono::milliseconds> used;
  for (int i = 0; i < 1000; ++i) {
    Push(queue, 1);
    Push(queue, 2);
  }
  for (int i = 0; i < 500; ++i) {
    const auto before = now_;
    const PoolJobPtr job = queue.Take(now_);
    now_ += job->terms.client == 1 ? 100ms : 10ms;
    queue.Finish(job, now_);
    used[job->terms.client] += std::chrono::duration_cast<std::chrono::milliseconds>(now_ - before);
  }
  EXPECT_LE(used[1] - used[2], 100ms);
  EXPECT_LE(used[2] - used[1], 100ms);
}

TEST_F(FairQueueTest, BeingIdleEarnsNothing) {
  FairQueue queue(1);
  Push(queue, 2);
  ASSERT_EQ(Serve(queue, 10ms), 2u);
  for (int i = 0; i < 100; ++i) Push(queue, 1);
  for (int i = 0; i < 50; ++i) ASSERT_EQ(Serve(queue, 10ms), 1u);
  for (int i = 0; i < 50; ++i) Push(queue, 2);
  int second = 0;
  for (int i = 0; i < 20; ++i) second += Serve(queue, 10ms) == 2;
  EXPECT_EQ(second, 10) << "from now on, each has a half";
}

TEST_F(FairQueueTest, NewcomersDoNotStarveWhoWaits) {
  FairQueue queue(1);
  Push(queue, 1);
  ASSERT_EQ(Serve(queue, 10ms), 1u);
  for (int i = 0; i < 2; ++i) Push(queue, 1);
  std::uint64_t newcomer = 100;
  int served = 0;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 2; ++k) Push(queue, newcomer++);  // twice as many as the number of served jobs
    served += Serve(queue, 10ms) == 1;
  }
  EXPECT_EQ(served, 2);
}

TEST_F(FairQueueTest, WhatRunsCountsBeforeItEnds) {
  FairQueue queue(3);
  Push(queue, 1, 0, /*is_long=*/true);
  Push(queue, 1, 0, /*is_long=*/true);
  Push(queue, 2, 0, /*is_long=*/true);
  const PoolJobPtr first = queue.Take(now_);
  now_ += 5s;
  EXPECT_EQ(queue.Take(now_)->terms.client, first->terms.client == 1 ? 2u : 1u);
}

TEST_F(FairQueueTest, LongJobsLeaveAThreadAndWaitForOneAnother) {
  FairQueue queue(2);
  for (int i = 0; i < 12; ++i) Push(queue, 1, 40, /*is_long=*/true);
  const PoolJobPtr first = queue.Take(now_);
  ASSERT_TRUE(first);
  EXPECT_FALSE(queue.HasNext());
  EXPECT_FALSE(queue.Take(now_));
  const PoolJobPtr tile = Push(queue, 1, 12);
  EXPECT_EQ(queue.Take(now_), tile) << "of the same client, behind its long ones";
  Push(queue, 2, 40, /*is_long=*/true);
  now_ += 10s;
  queue.Finish(first, now_);
  EXPECT_EQ(queue.Take(now_)->terms.client, 2u) << "the next long one is of who has used less";
  EXPECT_TRUE(queue.HasNext(/*all=*/true));
}

TEST_F(FairQueueTest, ASingleThreadRunsLongJobsToo) {
  FairQueue queue(1);
  Push(queue, 1, 40, /*is_long=*/true);
  EXPECT_TRUE(queue.Take(now_));
}

TEST_F(FairQueueTest, WhatIsRemovedIsNotServed) {
  FairQueue queue(1);
  std::vector<PoolJobPtr> jobs;
  for (int i = 0; i < 240; ++i) jobs.push_back(Push(queue, 1, i % 20, i % 3 == 0));
  for (const PoolJobPtr& job : jobs) EXPECT_TRUE(queue.Remove(job));
  EXPECT_EQ(queue.size(), 0u);
  EXPECT_FALSE(queue.HasNext());
  EXPECT_FALSE(queue.Remove(jobs[0]));
  const PoolJobPtr job = Push(queue, 1);
  EXPECT_EQ(queue.Take(now_), job);
  EXPECT_FALSE(queue.Remove(job)) << "it runs";
}

TEST_F(FairQueueTest, TheNewestOfTheLargestMakesRoom) {
  FairQueue queue(1);
  std::vector<PoolJobPtr> greedy;
  for (int i = 0; i < 5; ++i) greedy.push_back(Push(queue, 1, 20 - i));
  const PoolJobPtr polite = Push(queue, 2);
  EXPECT_EQ(queue.RemoveNewestOfLargest(), greedy[4]);
  EXPECT_EQ(queue.RemoveNewestOfLargest(), greedy[3]);
  EXPECT_EQ(queue.size(), 4u);
}

TEST_F(FairQueueTest, ExpectsToWaitForItsShareOfWhatIsAhead) {
  FairQueue queue(2);
  JobTerms greedy, polite, other;
  greedy.client = 1;
  polite.client = 2;
  other.client = 1;
  other.kind = 7;
  EXPECT_EQ(queue.ExpectedWait(greedy, now_).count(), 0) << "nothing is known yet";
  Push(queue, 1);
  Serve(queue, 100ms);
  for (int i = 0; i < 100; ++i) Push(queue, 1);
  EXPECT_NEAR(queue.ExpectedWait(greedy, now_).count(), 5.0, 1e-6)
      << "a hundred jobs of a tenth of a second, two at a time";
  EXPECT_NEAR(queue.ExpectedWait(polite, now_).count(), 0.05, 1e-6) << "one of the other's";
  EXPECT_NEAR(queue.ExpectedWait(other, now_).count(), 5.0, 1e-6) << "whatever it takes itself";
  for (int i = 0; i < 100; ++i) Push(queue, 3, 0, false, 7);
  other.client = 3;
  EXPECT_EQ(queue.ExpectedWait(other, now_).count(), 0) << "jobs of a kind that never ran are not counted";
}

}  // namespace
}  // namespace terrace::server
