// What pools keep for later, all together.
#include "engine/dem/common/idle_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

namespace terrace::dem {
namespace {

// Counts those that are there.
struct Thing {
  explicit Thing(int n) : number(n) { ++alive; }
  ~Thing() { --alive; }
  const int number;
  static inline std::atomic<int> alive{0};
};

class IdlePools : public testing::Test {
 protected:
  ~IdlePools() override { SetMostIdle(std::numeric_limits<std::size_t>::max()); }
};

TEST_F(IdlePools, GiveBackTheOneUsedLast) {
  IdlePool<Thing> pool;
  EXPECT_EQ(pool.Take().item, nullptr);
  pool.Keep({std::make_shared<Thing>(1), 0});
  pool.Keep({std::make_shared<Thing>(2), 0});
  const auto last = pool.Take();
  ASSERT_NE(last.item, nullptr);
  EXPECT_EQ(last.item->number, 2);
}

TEST_F(IdlePools, LetGoOfThoseUsedLongestAgoWhosesoeverTheyAre) {
  SetMostIdle(3);
  IdlePool<Thing> one, other;
  for (int i = 0; i < 3; ++i) one.Keep({std::make_shared<Thing>(i), 0});
  one.Keep(one.Take());
  for (int i = 10; i < 12; ++i) other.Keep({std::make_shared<Thing>(i), 0});
  EXPECT_EQ(Thing::alive, 3);
  const auto kept = one.Take();
  ASSERT_NE(kept.item, nullptr);
  EXPECT_EQ(kept.item->number, 2);
  EXPECT_EQ(one.Take().item, nullptr);
  SetMostIdle(1);
  EXPECT_EQ(Thing::alive, 2) << "what is in use does not count";
}

TEST_F(IdlePools, DoNotTakeBackWhatWasInUseWhenTheyWereCleared) {
  IdlePool<Thing> pool;
  pool.Keep({std::make_shared<Thing>(1), 0});
  auto in_use = pool.Take();
  pool.Clear();
  pool.Keep(std::move(in_use));
  EXPECT_EQ(Thing::alive, 0);
  const auto none = pool.Take();
  EXPECT_EQ(none.item, nullptr);
  pool.Keep({std::make_shared<Thing>(2), none.epoch});
  EXPECT_NE(pool.Take().item, nullptr);
}

TEST_F(IdlePools, TakeWhatTheyHaveWithThem) {
  {
    IdlePool<Thing> pool;
    pool.Keep({std::make_shared<Thing>(1), 0});
  }
  EXPECT_EQ(Thing::alive, 0);
}

TEST_F(IdlePools, AreForManyThreads) {
  SetMostIdle(5);
  IdlePool<Thing> pools[3];
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&pools, t] {
      for (int i = 0; i < 2000; ++i) {
        IdlePool<Thing>& pool = pools[(t + i) % 3];
        auto taken = pool.Take();
        if (taken.item == nullptr) taken.item = std::make_shared<Thing>(i);
        if (i % 100 == 0) pool.Clear();
        pool.Keep(std::move(taken));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(Thing::alive, 5);
}

}  // namespace
}  // namespace terrace::dem
