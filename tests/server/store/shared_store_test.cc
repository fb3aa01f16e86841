// The store behind the shared cache, with a Redis that this file plays. What is counted: look-ups that waited, and
// commands that reached the server.
#include "server/store/shared_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <new>
#include <thread>
#include <vector>

#include "tests/server/store/fake_redis.h"
#include "tiler/store/tile_record.h"

namespace terrace::server {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;

SharedStoreOptions OptionsOf(const FakeRedis& redis, std::size_t readers) {
  SharedStoreOptions options;
  options.address = redis.address();
  options.timeout = seconds(5);
  options.max_value_bytes = 1000;
  options.readers = readers;
  options.retry_after = hours(1);  // nothing is tried again while a test counts
  options.test_after = hours(1);
  return options;
}

void Await(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + seconds(60);
  while (!condition()) {
    ASSERT_LT(std::chrono::steady_clock::now(), end);
    std::this_thread::sleep_for(milliseconds(1));
  }
}

TEST(SharedStore, FindsWhatRedisHas) {
  FakeRedis redis;
  redis.SetValue(tiler::AddChecksum("key", "value"));
  SharedStore tier(OptionsOf(redis, 1));
  Await([&] { return redis.pings() >= 2; });  // one of the greeting, one that switches the store on
  Await([&] { return tier.stats().on; });
  EXPECT_EQ(tier.Find("key"), "value");
  EXPECT_EQ(tier.Find("other"), std::nullopt);  // the checksum is of another key
  EXPECT_EQ(tier.stats().hits, 1U);
  EXPECT_EQ(tier.stats().damaged, 1U);
}

TEST(SharedStore, AValueOfAServerWithAHigherLimitIsAMissAndStays) {
  FakeRedis redis;
  const SharedStoreOptions options = OptionsOf(redis, 1);
  SharedStore tier(options);
  Await([&] { return tier.stats().on; });
  const std::string longest(options.max_value_bytes, 'x');
  redis.SetValue(tiler::AddChecksum("key", longest));
  EXPECT_EQ(tier.Find("key"), longest);
  redis.SetValue(tiler::AddChecksum("key", longest + "x"));
  EXPECT_EQ(tier.Find("key"), std::nullopt);
  EXPECT_EQ(tier.stats().misses, 1U);
  EXPECT_EQ(tier.stats().damaged, 0U);
  tier.Keep(
      "other", [] { return std::string("value"); }, 5);  // written after all erasures
  Await([&] { return tier.stats().written == 1; });
  EXPECT_EQ(redis.erased(), 0U);
}

TEST(SharedStore, SilenceCostsOneTimeOutAndNoFurtherCommand) {
  FakeRedis redis;
  SharedStoreOptions options = OptionsOf(redis, 1);
  options.timeout = seconds(1);
  SharedStore tier(options);
  Await([&] { return tier.stats().on; });
  redis.FallSilent();
  constexpr std::uint64_t kLookUps = 1000;
  for (std::uint64_t i = 0; i < kLookUps; ++i) EXPECT_EQ(tier.Find("key"), std::nullopt);
  const tiler::StoreStats stats = tier.stats();
  EXPECT_EQ(stats.timeouts, 1U);
  EXPECT_EQ(stats.skipped, kLookUps - 1);
  EXPECT_EQ(stats.switched_off, 1U);
  EXPECT_FALSE(stats.on);
  Await([&] { return redis.look_ups() > 0; });
  EXPECT_EQ(redis.look_ups(), 1U) << "while it is switched off, no look-up sends a byte";
}

TEST(SharedStore, AnErrorSwitchesOffAsSilenceDoes) {
  FakeRedis redis;
  redis.SetReply("-LOADING Redis is loading\r\n");
  SharedStore tier(OptionsOf(redis, 1));
  Await([&] { return tier.stats().on; });
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tier.Find("key"), std::nullopt);
  EXPECT_EQ(tier.stats().timeouts, 0U);
  EXPECT_EQ(tier.stats().skipped, 99U);
  Await([&] { return redis.look_ups() > 0; });  // counted after the reply
  EXPECT_EQ(redis.look_ups(), 1U);
}

TEST(SharedStore, TheFirstFailureEndsAllLookUps) {
  FakeRedis redis;
  SharedStoreOptions options = OptionsOf(redis, 8);
  options.timeout = hours(1);  // nobody waits for it
  SharedStore tier(options);
  Await([&] { return redis.pings() >= 16; });
  Await([&] { return tier.stats().on; });
  redis.FallSilent();
  std::atomic<int> ended{0};
  std::vector<std::jthread> callers;
  for (int i = 0; i < 8; ++i) {
    // The store's thread may not yet have made a connection available: then a look-up is skipped at once.
    callers.emplace_back([&] {
      do {
        tier.Find("key");
      } while (redis.look_ups() < 8 && tier.stats().on);
      ++ended;
    });
  }
  Await([&] { return redis.look_ups() == 8; });
  EXPECT_EQ(ended, 0);
  redis.CloseOne();
  const auto end = std::chrono::steady_clock::now() + seconds(20);
  while (ended < 8 && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(ended, 8) << "connections that are all gone cost one time-out, not one each";
  redis.CloseAll();
  callers.clear();
  EXPECT_EQ(tier.stats().switched_off, 1U);
  EXPECT_EQ(tier.stats().errors, 1U);
}

TEST(SharedStore, ConnectionsThatAreSilentlyGoneAreFoundWithoutALookUp) {
  FakeRedis redis;
  SharedStoreOptions options = OptionsOf(redis, 4);
  options.timeout = seconds(1);
  options.test_after = milliseconds(100);
  SharedStore tier(options);
  Await([&] { return redis.pings() >= 12; });  // all four have been tested
  EXPECT_TRUE(tier.stats().on);
  redis.FallSilent();
  Await([&] { return !tier.stats().on; });
  EXPECT_EQ(tier.stats().timeouts, 1U) << "of the store's own thread";
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tier.Find("key"), std::nullopt);
  EXPECT_EQ(tier.stats().timeouts, 1U);
  EXPECT_EQ(redis.look_ups(), 0U);
}

TEST(SharedStore, ConnectionsThatRedisHasClosedAreReplacedWithoutAFailure) {
  FakeRedis redis;
  redis.SetValue(tiler::AddChecksum("key", "value"));
  SharedStoreOptions options = OptionsOf(redis, 2);
  SharedStore tier(options);
  Await([&] { return redis.pings() >= 4; });
  Await([&] { return tier.stats().on; });
  redis.CloseAll();
  EXPECT_EQ(tier.Find("key"), std::nullopt);  // both are found to be closed, and opened again by the store's thread
  Await([&] { return tier.Find("key").has_value(); });
  EXPECT_EQ(tier.stats().switched_off, 0U);
  EXPECT_EQ(tier.stats().errors, 0U);
}

TEST(SharedStore, DoesNotWriteOnAConnectionThatWasIdle) {
  FakeRedis redis;
  SharedStoreOptions options = OptionsOf(redis, 1);
  options.test_after = milliseconds(20);
  SharedStore tier(options);
  Await([&] { return tier.stats().on; });
  const auto value = [] { return std::string("value"); };
  tier.Keep("key", value, 5);
  Await([&] { return tier.stats().written == 1; });
  redis.DropWriters();
  std::this_thread::sleep_for(2 * options.test_after);
  tier.Keep("key", value, 5);
  Await([&] { return tier.stats().written == 2 || !tier.stats().on; });
  EXPECT_EQ(tier.stats().written, 2U);
  EXPECT_EQ(tier.stats().switched_off, 0U);
}

TEST(SharedStore, AValueThatCannotBeEncodedIsDropped) {
  FakeRedis redis;
  SharedStoreOptions options = OptionsOf(redis, 1);
  options.retry_after = milliseconds(1);
  SharedStore tier(options);
  Await([&] { return tier.stats().on; });
  tier.Keep(
      "key", []() -> std::string { throw std::bad_alloc(); }, 5);
  Await([&] { return tier.stats().dropped == 1; });
  EXPECT_EQ(tier.stats().errors, 1U);
  tier.Keep(
      "key", [] { return std::string("value"); }, 5);
  Await([&] { return tier.stats().written == 1; });
}

TEST(SharedStore, ErasesAlsoWhileValuesAreWrittenWithoutEnd) {
  FakeRedis redis;
  std::atomic<bool> goes_on{true};
  std::function<std::string()> value;
  SharedStore tier(OptionsOf(redis, 1));
  Await([&] { return tier.stats().on; });
  // While it is written, the next one is waiting.
  value = [&] {
    if (goes_on) tier.Keep("key", value, 5);
    return std::string("value");
  };
  tier.Keep("key", value, 5);
  Await([&] { return tier.stats().written > 0; });
  auto erased = std::async(std::launch::async, [&] { return tier.Erase("a", [](auto) { return true; }, {}); });
  EXPECT_EQ(erased.wait_for(seconds(20)), std::future_status::ready);
  goes_on = false;
  EXPECT_EQ(erased.get().value_or(1), 0U);
}

TEST(SharedStore, ReleasesOnlyItsOwnLeases) {
  FakeRedis redis;
  SharedStore tier(OptionsOf(redis, 1));
  Await([&] { return tier.stats().on; });
  EXPECT_EQ(tier.Take("own", hours(1)), SharedStore::Lease::kTaken);
  tier.Release("own");
  tier.Release("own");  // it has none any more
  EXPECT_EQ(tier.Take("short", milliseconds(1)), SharedStore::Lease::kTaken);
  std::this_thread::sleep_for(milliseconds(2));
  tier.Release("short");  // another server may have it by now
  redis.HoldLeases();
  EXPECT_EQ(tier.Take("other", hours(1)), SharedStore::Lease::kHeld);
  tier.Release("other");
  tier.Keep(
      "key", [] { return std::string("value"); }, 5);  // written after all releases
  Await([&] { return tier.stats().written == 1 && redis.erased() > 0; });
  EXPECT_EQ(redis.erased(), 1U);
}

TEST(SharedStore, ComesBackWhenRedisAnswers) {
  FakeRedis redis;
  redis.SetValue(tiler::AddChecksum("key", "value"));
  SharedStoreOptions options = OptionsOf(redis, 1);
  options.timeout = seconds(1);
  options.retry_after = milliseconds(20);
  SharedStore tier(options);
  Await([&] { return tier.stats().on; });
  redis.FallSilent();
  EXPECT_EQ(tier.Find("key"), std::nullopt);
  redis.Speak();
  Await([&] { return tier.Find("key").has_value(); });
  EXPECT_EQ(tier.stats().switched_off, 1U);
}

}  // namespace
}  // namespace terrace::server
