#include "engine/tin/mesh/spare_blocks.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>
#include <utility>
#include <vector>

#include "engine/tin/greedy.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr std::size_t kBytes = 100000;

class SpareBlocks : public testing::Test {
 protected:
  void SetUp() override { ReleaseSpareBlocks(); }
  void TearDown() override { ReleaseSpareBlocks(); }
};

TEST_F(SpareBlocks, KeepsABlockForTheNextThatFits) {
  void* const block = TakeBlock(kBytes);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(block) % 64, 0u);
  GiveBlock(block);
  EXPECT_EQ(SpareBytes(), kBytes);
  void* const larger = TakeBlock(kBytes + 1);
  EXPECT_EQ(SpareBytes(), kBytes);
  void* const much_smaller = TakeBlock(kBytes / 2 - 1);
  EXPECT_EQ(SpareBytes(), kBytes);
  EXPECT_EQ(TakeBlock(kBytes / 2), block);
  EXPECT_EQ(SpareBytes(), 0u);
  for (void* const taken : {block, larger, much_smaller}) GiveBlock(taken);
}

TEST_F(SpareBlocks, KeepsNoMoreThanTheMost) {
  std::vector<void*> blocks;
  for (std::size_t i = 0; i < 3; ++i) blocks.push_back(TakeBlock(kMaxSpareBytes / 2));
  blocks.push_back(TakeBlock(kMaxSpareBytes + 1));
  for (std::size_t i = 0; i < 100; ++i) blocks.push_back(TakeBlock(kBytes));
  for (void* const block : blocks) {
    GiveBlock(block);
    EXPECT_LE(SpareBytes(), kMaxSpareBytes);
  }
  EXPECT_GT(SpareBytes(), 0u);
  ReleaseSpareBlocks();
  EXPECT_EQ(SpareBytes(), 0u);
}

TEST_F(SpareBlocks, GivesABlockToTheThreadThatGivesItBack) {
  void* block = TakeBlock(kBytes);
  std::thread([&] {
    GiveBlock(block);
    EXPECT_EQ(SpareBytes(), kBytes);
    block = TakeBlock(kBytes);
  }).join();
  EXPECT_EQ(SpareBytes(), 0u);
  GiveBlock(block);
  EXPECT_EQ(SpareBytes(), kBytes);
}

TEST_F(SpareBlocks, GrowsABlockThatKeepsItsContents) {
  auto* block = static_cast<std::uint8_t*>(TakeBlock(kBytes));
  for (std::size_t i = 0; i < kBytes; ++i) block[i] = static_cast<std::uint8_t>(i * 7);
  const auto is_kept = [&] {
    for (std::size_t i = 0; i < kBytes; ++i) {
      if (block[i] != static_cast<std::uint8_t>(i * 7)) return false;
    }
    return true;
  };
  block = static_cast<std::uint8_t*>(GrowBlock(block, kBytes, 40 * kBytes));  // moved by the system
  EXPECT_TRUE(is_kept());
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(block) % 64, 0u);
  block[40 * kBytes - 1] = 1;
  void* const spare = TakeBlock(50 * kBytes);
  GiveBlock(spare);
  block = static_cast<std::uint8_t*>(GrowBlock(block, kBytes, 45 * kBytes));  // copied into the existing block
  EXPECT_EQ(block, spare);
  EXPECT_TRUE(is_kept());
  EXPECT_EQ(SpareBytes(), 40 * kBytes);
  GiveBlock(block);
}

TEST_F(SpareBlocks, AreNotKeptWhenReleased) {
  LargeArray<int> array;
  array.GrowTo(100'000, 7);
  array.Release();
  EXPECT_EQ(SpareBytes(), 0u);
  EXPECT_TRUE(array.empty());
  array.GrowTo(3, 8);
  EXPECT_EQ(array[2], 8);
  LargeArray<int>().Release();
}

TEST_F(SpareBlocks, HoldLargeArrays) {
  LargeArray<std::uint32_t> array;
  EXPECT_TRUE(array.empty());
  for (std::uint32_t i = 0; i < 200000; ++i) array.push_back(i == 0 ? 0 : array[i - 1] + 1);
  array.push_back(array[17]);  // an element of the array itself, which may move meanwhile
  array.GrowTo(300000, 5);
  EXPECT_EQ(array.size(), 300000u);
  for (std::uint32_t i = 0; i < 200000; ++i) ASSERT_EQ(array[i], i);
  EXPECT_EQ(array[200000], 17u);
  for (std::uint32_t i = 200001; i < 300000; ++i) ASSERT_EQ(array[i], 5u);
  LargeArray<std::uint32_t> moved(std::move(array));
  EXPECT_EQ(moved.size(), 300000u);
  array = std::move(moved);
  EXPECT_EQ(array[299999], 5u);
  const std::size_t before = SpareBytes();
  array = {};
  EXPECT_GT(SpareBytes(), before);
}

// The content that an earlier run left must have no effect.
TEST_F(SpareBlocks, MakeTheSameMesh) {
  const HeightField field = NoiseField(120, 90, 1), other = NoiseField(90, 130, 2);
  const auto mesh_of = [](const HeightField& of) {
    GreedyTriangulation tin(of);
    tin.Run({0.1});
    return tin.Mesh();
  };
  const TinMesh fresh = mesh_of(field);
  EXPECT_GT(SpareBytes(), 0u);
  mesh_of(other);
  const TinMesh again = mesh_of(field);
  EXPECT_EQ(again.vertices, fresh.vertices);
  EXPECT_EQ(again.triangles, fresh.triangles);
}

}  // namespace
}  // namespace terrace::tin
