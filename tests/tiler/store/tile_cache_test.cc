#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "tiler/store/byte_cache.h"
#include "tiler/store/tile_store.h"
#include "tiler/store/tile_tiers.h"

namespace terrace::tiler {
namespace {

constexpr std::size_t kBody = 1000;
constexpr std::size_t kCharge = kBody + TileCache::kEntryOverheadBytes;

CacheKey Key(int x, std::uint64_t generation = 1) {
  CacheKey key;
  key.request.key = geo::TileKey{10, x, 3};
  key.generation = generation;
  return key;
}

TilePtr Tile(char fill = 'x', std::size_t bytes = kBody) {
  EncodedTile tile;
  tile.bytes.assign(bytes, fill);
  return std::make_shared<const EncodedTile>(std::move(tile));
}

TEST(TileCache, FindsWhatWasInserted) {
  TileCache cache(10 * kCharge);
  const TilePtr tile = Tile();
  cache.Insert(Key(1), tile);
  EXPECT_EQ(cache.Find(Key(1)), tile);
  EXPECT_EQ(cache.Find(Key(2)), nullptr);
}

TEST(TileCache, ErasesWhatIsChosenAndKeepsItsBooks) {
  TileCache cache(100 * kCharge);
  for (int x = 1; x <= 9; ++x) cache.Insert(Key(x), Tile());
  ASSERT_NE(cache.Find(Key(2)), nullptr);  // in the protected part
  EXPECT_EQ(cache.EraseIf([](const CacheKey& key) { return key.request.key.x % 2 == 0; }), 4u);
  for (int x = 1; x <= 9; ++x) EXPECT_EQ(cache.Find(Key(x)) != nullptr, x % 2 == 1) << x;
  EXPECT_EQ(cache.stats().entries, 5u);
  EXPECT_EQ(cache.stats().bytes, 5 * kCharge);
  cache.Insert(Key(2), Tile());
  EXPECT_NE(cache.Find(Key(2)), nullptr);
}

// A choice that takes long holds nobody up: here it would wait for itself.
TEST(TileCache, IsFreeWhileItIsChosenWhatToErase) {
  TileCache cache(100 * kCharge);
  for (int x = 1; x <= 4; ++x) cache.Insert(Key(x), Tile());
  EXPECT_EQ(cache.EraseIf([&](const CacheKey& key) { return key.request.key.x > 2 && cache.Find(key) != nullptr; }),
            2u);
  EXPECT_EQ(cache.stats().entries, 2u);
}

TEST(TileCache, EvictsOldestWhenOverBudget) {
  TileCache cache(3 * kCharge);
  for (int x = 1; x <= 4; ++x) cache.Insert(Key(x), Tile());
  EXPECT_EQ(cache.Find(Key(1)), nullptr);
  for (int x = 2; x <= 4; ++x) EXPECT_NE(cache.Find(Key(x)), nullptr) << x;
  EXPECT_EQ(cache.stats().entries, 3u);
  EXPECT_EQ(cache.stats().bytes, 3 * kCharge);
}

TEST(TileCache, KeepsWhatWasFoundLately) {
  TileCache cache(3 * kCharge);
  for (int x = 1; x <= 3; ++x) cache.Insert(Key(x), Tile());
  ASSERT_NE(cache.Find(Key(1)), nullptr);
  cache.Insert(Key(4), Tile());
  EXPECT_NE(cache.Find(Key(1)), nullptr);
  EXPECT_EQ(cache.Find(Key(2)), nullptr);
}

TEST(TileCache, EvictsSeveralSmallTilesForALargeOne) {
  TileCache cache(4 * kCharge);
  for (int x = 1; x <= 4; ++x) cache.Insert(Key(x), Tile());
  cache.Insert(Key(5), Tile('y', 3 * kCharge - TileCache::kEntryOverheadBytes));
  EXPECT_EQ(cache.stats().entries, 2u);
  EXPECT_NE(cache.Find(Key(4)), nullptr);
  EXPECT_NE(cache.Find(Key(5)), nullptr);
}

TEST(TileCache, ReplacesAnEntryWithoutChargingTwice) {
  TileCache cache(3 * kCharge);
  cache.Insert(Key(1), Tile('a'));
  cache.Insert(Key(1), Tile('b'));
  EXPECT_EQ(cache.Find(Key(1))->bytes[0], 'b');
  EXPECT_EQ(cache.stats().bytes, kCharge);
}

TEST(TileCache, DoesNotKeepWhatIsLargerThanItsBudget) {
  TileCache cache(3 * kCharge);
  cache.Insert(Key(1), Tile());
  cache.Insert(Key(2), Tile('y', 4 * kCharge));
  EXPECT_NE(cache.Find(Key(1)), nullptr);
  EXPECT_EQ(cache.Find(Key(2)), nullptr);
}

TEST(TileCache, IsOffWithoutCapacity) {
  TileCache cache(0);
  cache.Insert(Key(1), Tile('x', 0));
  EXPECT_EQ(cache.Find(Key(1)), nullptr);
  EXPECT_EQ(cache.stats().entries, 0u);
}

TEST(TileCache, SeparatesEverythingThatChangesBytes) {
  TileCache cache(100 * kCharge);
  std::vector<CacheKey> keys(10, Key(1));
  keys[1].request.dataset = 1;
  keys[2].request.error_step = -1;
  keys[3].request.coding = Coding::kGzip;
  keys[4].request.extensions.normals = true;
  keys[5].generation = 2;
  keys[6].request.key.level = 11;
  keys[7].request.extensions.water_mask = true;
  keys[8].request.extensions.metadata = true;
  keys[9].request.texture = proto::TextureFormat::kJpeg;
  for (std::size_t i = 0; i < keys.size(); ++i) cache.Insert(keys[i], Tile(static_cast<char>('a' + i)));
  for (std::size_t i = 0; i < keys.size(); ++i) {
    EXPECT_EQ(cache.Find(keys[i])->bytes[0], static_cast<char>('a' + i)) << i;
  }
}

TEST(TileCache, RetainsTheGenerationsItIsToldOf) {
  TileCache cache(100 * kCharge);
  for (std::uint64_t generation = 1; generation <= 3; ++generation) cache.Insert(Key(1, generation), Tile());
  ASSERT_NE(cache.Find(Key(1, 2)), nullptr);
  cache.Retain({1, 3});
  EXPECT_NE(cache.Find(Key(1, 1)), nullptr);
  EXPECT_EQ(cache.Find(Key(1, 2)), nullptr);
  EXPECT_NE(cache.Find(Key(1, 3)), nullptr);
  cache.Insert(Key(1, 2), Tile());
  EXPECT_EQ(cache.Find(Key(1, 2)), nullptr) << "a build that lands late";
  EXPECT_EQ(cache.stats().bytes, 2 * kCharge);
  cache.AlsoRetain({2});
  cache.Insert(Key(1, 2), Tile());
  EXPECT_NE(cache.Find(Key(1, 2)), nullptr) << "back again";
  EXPECT_NE(cache.Find(Key(1, 1)), nullptr) << "beside the others";
  cache.Retain({2});
  EXPECT_NE(cache.Find(Key(1, 2)), nullptr);
  EXPECT_EQ(cache.stats().entries, 1u);
}

TEST(TileCache, GivesBackWhatASmallerBudgetCannotHold) {
  TileCache cache(4 * kCharge);
  for (int x = 1; x <= 4; ++x) cache.Insert(Key(x), Tile());
  cache.SetCapacity(2 * kCharge);
  EXPECT_EQ(cache.stats().bytes, 2 * kCharge);
  EXPECT_EQ(cache.Find(Key(2)), nullptr);
  EXPECT_NE(cache.Find(Key(4)), nullptr);
  cache.SetCapacity(3 * kCharge);
  cache.Insert(Key(5), Tile());
  EXPECT_EQ(cache.stats().entries, 3u);
  cache.SetCapacity(0);
  EXPECT_EQ(cache.stats().bytes, 0u);
}

// Row 22 of docs/reliability.md: a crawler requests ten times the size of the cache, each tile once, while clients
// continue to request tiles that fill 60 % of it. A list of least recently used tiles keeps less than a fifth of the
// hits.
TEST(TileCache, KeepsTheHotSetThroughAScan) {
  constexpr int kTiles = 1000, kHot = 600, kScan = 10 * kTiles;
  TileCache cache(kTiles * kCharge);
  for (int round = 0; round < 2; ++round) {
    for (int x = 0; x < kHot; ++x) {
      if (!cache.Find(Key(x))) cache.Insert(Key(x), Tile());
    }
  }
  int hits = 0, asked = 0;
  for (int scanned = 0; scanned < kScan; ++scanned) {
    const CacheKey key = Key(kTiles + scanned);
    EXPECT_EQ(cache.Find(key), nullptr);
    cache.Insert(key, Tile());
    if (scanned % 10 != 0) continue;  // the crawler is ten times as fast
    const CacheKey hot = Key(asked++ * 7 % kHot);
    if (cache.Find(hot)) {
      ++hits;
    } else {
      cache.Insert(hot, Tile());
    }
  }
  EXPECT_GE(hits, asked * 95 / 100) << "of " << asked;
  EXPECT_EQ(cache.stats().entries, static_cast<std::size_t>(kTiles));
}

// The hot set changes: tiles requested now enter the cache, earlier hot tiles leave it.
TEST(TileCache, FollowsTheHotSet) {
  constexpr int kTiles = 100;
  TileCache cache(kTiles * kCharge);
  const auto ask = [&](int x) {
    const bool found = cache.Find(Key(x)) != nullptr;
    if (!found) cache.Insert(Key(x), Tile());
    return found;
  };
  for (int i = 0; i < 5 * kTiles; ++i) ask(i % kTiles);
  int hits = 0;
  for (int round = 0; round < 10; ++round) {
    hits = 0;
    for (int x = 0; x < 60; ++x) hits += ask(1000 + x) ? 1 : 0;
    for (int x = 0; x < 60; ++x) hits += ask(1000 + x) ? 1 : 0;
  }
  EXPECT_EQ(hits, 120);
  for (int x = 0; x < 50; ++x) ask(2000 + x);
  int old = 0;
  for (int x = 0; x < kTiles; ++x) old += cache.Find(Key(x)) != nullptr ? 1 : 0;
  EXPECT_LT(old, 40);
}

TEST(TileCache, WhatIsReplacedStaysProtected) {
  TileCache cache(5 * kCharge);
  cache.Insert(Key(1), Tile('a'));
  ASSERT_NE(cache.Find(Key(1)), nullptr);
  cache.Insert(Key(1), Tile('b'));
  for (int x = 2; x < 20; ++x) cache.Insert(Key(x), Tile());
  const TilePtr found = cache.Find(Key(1));
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->bytes[0], 'b');
}

TEST(TileCache, StaysInBudgetUnderManyThreads) {
  constexpr std::size_t kCapacity = std::size_t{64} << 20;  // large enough for shards
  TileCache cache(kCapacity);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&cache, t] {
      for (int i = 0; i < 2000; ++i) {
        const int x = (i * 7 + t * 13) % 3000;
        const TilePtr found = cache.Find(Key(x));
        if (found) {
          ASSERT_EQ(found->bytes[0], static_cast<char>(x % 100));
        }
        cache.Insert(Key(x), Tile(static_cast<char>(x % 100), 40'000));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const CacheStats stats = cache.stats();
  EXPECT_LE(stats.bytes, kCapacity);
  EXPECT_EQ(stats.bytes, stats.entries * (40'000 + TileCache::kEntryOverheadBytes));
}

}  // namespace
}  // namespace terrace::tiler
