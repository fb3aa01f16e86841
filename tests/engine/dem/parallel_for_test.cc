#include "engine/common/parallel_for.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <latch>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

namespace terrace::dem {
namespace {

TEST(ParallelFor, WorkIsDoneAtOnceAndOnce) {
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "one core";
  std::vector<int> done(100);
  std::latch both(2);
  bool met = true;
  ParallelFor(done.size(), [&](std::size_t i) {
    ++done[i];
    if (i > 1) return true;
    // The first two wait for each other.
    both.count_down();
    for (int waited = 0; !both.try_wait() && waited < 3000; ++waited)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (!both.try_wait()) met = false;
    return true;
  });
  EXPECT_TRUE(met);
  EXPECT_EQ(std::ranges::count(done, 1), 100);
}

TEST(ParallelFor, OneThreadIsTheCaller) {
  std::vector<std::thread::id> threads;
  const auto work = [&](std::size_t i) {
    EXPECT_EQ(i, threads.size());
    threads.push_back(std::this_thread::get_id());
    return true;
  };
  ParallelFor(100, work, /*threads=*/1);
  EXPECT_EQ(threads, std::vector(100, std::this_thread::get_id()));
}

TEST(ParallelFor, NothingBeginsAfterFalseAndWhatIsThrownComesOut) {
  std::size_t begun = 0;
  std::mutex mutex;
  EXPECT_THROW(ParallelFor(10'000,
                           [&](std::size_t i) -> bool {
                             {
                               const std::lock_guard lock(mutex);
                               ++begun;
                             }
                             if (i == 3) throw std::runtime_error("three");
                             // The others take ten seconds: longer than an exception on a busy machine.
                             std::this_thread::sleep_for(std::chrono::milliseconds(1));
                             return true;
                           }),
               std::runtime_error);
  EXPECT_LT(begun, 10'000U);
}

}  // namespace
}  // namespace terrace::dem
