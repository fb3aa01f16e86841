#include "engine/tin/spare_blocks.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>
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
  for (std::size_t i = 0; i < 3; ++i) blocks.push_back(TakeBlock(kMostSpareBytes / 2));
  blocks.push_back(TakeBlock(kMostSpareBytes + 1));
  for (std::size_t i = 0; i < 100; ++i) blocks.push_back(TakeBlock(kBytes));
  for (void* const block : blocks) {
    GiveBlock(block);
    EXPECT_LE(SpareBytes(), kMostSpareBytes);
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

// Whatever the run before left in them.
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
