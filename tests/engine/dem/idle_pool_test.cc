// Idle objects of several pools, with a common limit.
#include "engine/common/idle_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

namespace terrace::dem {
namespace {

// Counts its instances.
struct Thing {
  explicit Thing(int n) : number(n) { ++alive; }
  ~Thing() { --alive; }
  const int number;
  static inline std::atomic<int> alive{0};
};

// Puts things into the pool as if after use.
void Keep(IdlePool<Thing>& pool, std::vector<int> numbers) {
  std::vector<IdlePool<Thing>::Handle> handles;
  for (const int number : numbers) {
    handles.push_back(pool.Take());
    handles.back().Set(std::make_shared<Thing>(number));
  }
  for (auto& handle : handles) auto done = std::move(handle);
}

class IdlePools : public testing::Test {
 protected:
  ~IdlePools() override { SetMaxIdle(std::numeric_limits<std::size_t>::max()); }
};

TEST_F(IdlePools, GiveBackTheOneUsedLast) {
  IdlePool<Thing> pool;
  EXPECT_FALSE(pool.Take());
  Keep(pool, {1, 2});
  const auto last = pool.Take();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->number, 2);
}

TEST_F(IdlePools, LetGoOfThoseUsedLongestAgoWhosesoeverTheyAre) {
  SetMaxIdle(3);
  IdlePool<Thing> one, other;
  Keep(one, {0, 1, 2});
  EXPECT_TRUE(one.Take());
  Keep(other, {10, 11});
  EXPECT_EQ(Thing::alive, 3);
  const auto kept = one.Take();
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->number, 2);
  EXPECT_FALSE(one.Take());
  SetMaxIdle(1);
  EXPECT_EQ(Thing::alive, 2) << "what is in use does not count";
}

TEST_F(IdlePools, DoNotTakeBackWhatWasInUseWhenTheyWereCleared) {
  IdlePool<Thing> pool;
  Keep(pool, {1});
  {
    const auto in_use = pool.Take();
    EXPECT_TRUE(in_use);
    pool.Clear();
  }
  EXPECT_EQ(Thing::alive, 0);
  EXPECT_FALSE(pool.Take());
  Keep(pool, {2});
  EXPECT_TRUE(pool.Take());
}

TEST_F(IdlePools, TakeWhatTheyHaveWithThem) {
  {
    IdlePool<Thing> pool;
    Keep(pool, {1});
  }
  EXPECT_EQ(Thing::alive, 0);
}

TEST_F(IdlePools, AreForManyThreads) {
  SetMaxIdle(5);
  IdlePool<Thing> pools[3];
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&pools, t] {
      for (int i = 0; i < 2000; ++i) {
        IdlePool<Thing>& pool = pools[(t + i) % 3];
        auto taken = pool.Take();
        if (!taken) taken.Set(std::make_shared<Thing>(i));
        if (i % 100 == 0) pool.Clear();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(Thing::alive, 5);
}

}  // namespace
}  // namespace terrace::dem
