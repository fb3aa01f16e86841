#include "engine/common/lru_block_cache.h"

#include <gtest/gtest.h>

#include <memory>

namespace terrace::dem {
namespace {

using Blocks = LruBlockCache<int, int>;

TEST(LruBlockCache, TheLeastRecentlyUsedOnesAreDropped) {
  Blocks blocks(30);
  for (int key = 1; key <= 3; ++key) blocks.Insert(key, std::make_shared<int>(10 * key), 10);
  EXPECT_EQ(*blocks.Find(1), 10);
  blocks.Insert(4, std::make_shared<int>(40), 10);
  EXPECT_EQ(blocks.Find(2), nullptr);
  for (const int key : {1, 3, 4}) EXPECT_EQ(*blocks.Find(key), 10 * key);
  EXPECT_EQ(blocks.bytes(), 30U);
  EXPECT_EQ(blocks.count(), 3U);
}

TEST(LruBlockCache, TheFirstBlockOfAKeyStays) {
  Blocks blocks(30);
  blocks.Insert(1, std::make_shared<int>(10), 10);
  blocks.Insert(1, std::make_shared<int>(11), 20);
  EXPECT_EQ(*blocks.Find(1), 10);
  EXPECT_EQ(blocks.bytes(), 10U);
}

TEST(LruBlockCache, ABlockOfMoreThanTheCapacityIsKeptAlone) {
  Blocks blocks(30);
  blocks.Insert(1, std::make_shared<int>(10), 10);
  blocks.Insert(2, std::make_shared<int>(20), 31);
  EXPECT_EQ(blocks.Find(1), nullptr);
  EXPECT_NE(blocks.Find(2), nullptr);
  blocks.Insert(3, std::make_shared<int>(30), 10);
  EXPECT_EQ(blocks.Find(2), nullptr);
  EXPECT_EQ(blocks.bytes(), 10U);
}

TEST(LruBlockCache, AnErasedBlockIsGoneAndDoesNotCount) {
  Blocks blocks(30);
  for (int key = 1; key <= 3; ++key) blocks.Insert(key, std::make_shared<int>(key), 10);
  blocks.Erase(2);
  blocks.Erase(7);
  EXPECT_EQ(blocks.Find(2), nullptr);
  EXPECT_EQ(blocks.bytes(), 20U);
  blocks.Insert(4, std::make_shared<int>(4), 10);
  EXPECT_NE(blocks.Find(1), nullptr);
}

TEST(LruBlockCache, ADroppedBlockLivesAsLongAsSomebodyUsesIt) {
  Blocks blocks(10);
  blocks.Insert(1, std::make_shared<int>(10), 10);
  const Blocks::BlockPtr block = blocks.Find(1);
  blocks.Insert(2, std::make_shared<int>(20), 10);
  EXPECT_EQ(blocks.Find(1), nullptr);
  EXPECT_EQ(*block, 10);
}

}  // namespace
}  // namespace terrace::dem
