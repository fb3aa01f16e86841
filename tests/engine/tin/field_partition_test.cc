#include "engine/tin/extended/field_partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/tin/extended/block_joiner.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/support/test_data.h"

namespace terrace::tin {
namespace {

TinMesh MeshInBlocks(const HeightField& field, const FieldPartition& cut, double error) {
  BlockJoiner joiner(cut);
  for (std::size_t i = 0; i < cut.size(); ++i) {
    const std::optional<TinMesh> mesh = MeshBlock(field, cut.block(i), error);
    EXPECT_TRUE(mesh && IsDelaunay(*mesh));
    joiner.Add(*mesh);
  }
  return std::move(joiner).Take();
}

TinMesh MeshWhole(const HeightField& field, double error) {
  GreedyTriangulation greedy(field);
  EXPECT_TRUE(greedy.Run({error}));
  return greedy.Mesh();
}

// The joined mesh keeps all laws of a mesh except the Delaunay criterion.
void ExpectLawful(const HeightField& field, int block_cells, double error) {
  const TinMesh mesh = MeshInBlocks(field, FieldPartition(field.width(), field.height(), block_cells), error);
  EXPECT_TRUE(CoversExactly(field, mesh)) << field.width() << " x " << field.height() << " at " << error;
  EXPECT_TRUE(IsWithin(field, mesh, error)) << field.width() << " x " << field.height() << " at " << error;
}

TEST(FieldPartition, CoversEveryCellOnceWithBlocksOfLikeSize) {
  for (const auto& [width, height] : {std::pair{2, 2},
                                      {257, 257},
                                      {258, 258},
                                      {259, 2},
                                      {513, 514},
                                      {515, 640},
                                      {642, 1000},
                                      {1000, 3},
                                      {32768, 385}}) {
    const FieldPartition cut(width, height, 256);
    EXPECT_EQ(cut.width(), width);
    EXPECT_EQ(cut.height(), height);
    int x = 0, y = 0;
    for (std::size_t i = 0; i < cut.size(); ++i) {
      const FieldBlock block = cut.block(i);
      EXPECT_EQ((std::pair{block.x, block.y}), (std::pair{x, y}));
      for (const auto& [side, whole] : {std::pair{block.width, width}, {block.height, height}}) {
        EXPECT_GT(side, std::min(whole - 1, 170));
        EXPECT_LE(side, 385);
      }
      x += block.width - 1;
      if (x < width - 1) continue;
      EXPECT_EQ(x, width - 1);
      x = 0;
      y += block.height - 1;
    }
    EXPECT_EQ(y, height - 1);
  }
}

TEST(FieldPartition, JoinsToOneCoverThatKeepsTheBound) {
  for (const double error : {0.0, 0.5, 4.0, 30.0}) {
    ExpectLawful(HillField(130, 97, 1), 32, error);
    ExpectLawful(NoiseField(50, 61, 2), 16, error);
    ExpectLawful(StepField(64, 64, 40, 3), 8, error);
  }
}

TEST(FieldPartition, JoinsFieldsOfEverySize) {
  for (const auto& [width, height] : {std::pair{258, 258},
                                      {259, 258},
                                      {513, 300},
                                      {300, 514},
                                      {515, 514},
                                      {1000, 3},
                                      {3, 1000},
                                      {2, 700},
                                      {700, 2}}) {
    for (const double error : {2.0, 40.0}) ExpectLawful(HillField(width, height, 4), 128, error);
  }
}

TEST(FieldPartition, JoinsBlocksOfOneCell) {
  for (int width = 2; width < 6; ++width) ExpectLawful(NoiseField(width, 4, 5), 1, 10);
}

TEST(FieldPartition, GivesCornersInAVoidTheHeightOfTheWholeField) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    // A wide void that contains whole blocks, and single voids everywhere, also at corners of blocks.
    Random random(seed);
    const HeightField field = MakeField(90, 75, [&](int x, int y) {
      return (x + y > 40 && x + y < 110) || random.Below(4) == 0 ? kVoid : HillHeight(x, y, seed);
    });
    for (const double error : {0.0, 3.0, 50.0}) ExpectLawful(field, 11, error);
  }
}

TEST(FieldPartition, MeetsABlockOfVoidsWithTwoTriangles) {
  const HeightField field = MakeField(41, 21, [](int x, int y) { return x < 20 ? HillHeight(x, y, 1) : kVoid; });
  const FieldPartition cut(41, 21, 20);
  ASSERT_EQ(cut.size(), 2u);
  EXPECT_EQ(MeshBlock(field, cut.block(1), 1000)->triangles.size(), 2u);
}

TEST(FieldPartition, GivesTheSameMeshInWhateverOrderBlocksAreMeshed) {
  const HeightField field = HillField(140, 120, 6);
  const FieldPartition cut(140, 120, 32);
  std::vector<std::size_t> order(cut.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  Random random(7);
  for (int round = 0; round < 3; ++round) {
    for (std::size_t i = order.size() - 1; i > 0; --i) {
      std::swap(order[i], order[static_cast<std::size_t>(random.Below(static_cast<int>(i) + 1))]);
    }
    std::vector<TinMesh> meshes(cut.size());
    for (const std::size_t i : order) meshes[i] = *MeshBlock(field, cut.block(i), 3);
    BlockJoiner joiner(cut);
    for (const TinMesh& mesh : meshes) joiner.Add(mesh);
    EXPECT_TRUE(AreEqual(std::move(joiner).Take(), MeshInBlocks(field, cut, 3)));
  }
}

TEST(FieldPartition, MeshesALoneBlockAsTheWholeField) {
  const HeightField field = HillField(60, 50, 8);
  EXPECT_TRUE(AreEqual(MeshInBlocks(field, FieldPartition(60, 50, 256), 2), MeshWhole(field, 2)));
}

TEST(FieldPartition, MakesBordersBetweenBlocksDenserAndNoOthers) {
  const HeightField field = HillField(150, 110, 9);
  const FieldBlock block = FieldPartition(150, 110, 40).block(0);
  const HeightField part = MakeField(block.width, block.height, [&](int x, int y) { return field.At(x, y); });
  const TinMesh mesh = *MeshBlock(field, block, 9), plain = MeshWhole(part, 9), finer = MeshWhole(part, 6);
  for (const Side outer : {Side::kSouth, Side::kWest}) {
    EXPECT_EQ(BorderVertices(part, mesh, outer), BorderVertices(part, plain, outer));
  }
  for (const Side shared : {Side::kEast, Side::kNorth}) {
    EXPECT_EQ(BorderVertices(part, mesh, shared), BorderVertices(part, finer, shared));
    EXPECT_NE(BorderVertices(part, mesh, shared), BorderVertices(part, plain, shared));
  }
}

TEST(FieldPartition, CutsFinelyOnlyWhereBordersCostLittle) {
  const HeightField hills = HillField(600, 560, 10);
  EXPECT_EQ(FieldPartition::For(hills, 0.5).size(), 4u);
  EXPECT_EQ(FieldPartition::For(hills, 1000).size(), 1u);
  EXPECT_EQ(FieldPartition::For(HillField(257, 257, 10), 0).size(), 1u);
  const HeightField plane = MakeField(1200, 600, [](int x, int y) { return static_cast<float>(x - y); });
  EXPECT_EQ(FieldPartition::For(plane, 0).size(), 1u);
}

TEST(FieldPartition, LeavesSmallFieldsAndSmallMeshesWhole) {
  const HeightField small = HillField(500, 300, 12), large = HillField(900, 700, 12);
  EXPECT_EQ(FieldPartition::For(large, 8).size(), 12u);
  EXPECT_EQ(FieldPartition::For(small, 8).size(),
            1u);  // the same density of vertices, but the whole field fits into the cache
  EXPECT_EQ(FieldPartition::For(large, 100).size(), 1u);
}

// Sea does not make blocks larger.
TEST(FieldPartition, CutsAnIslandAsFinelyAsTheLandAlone) {
  const HeightField land = HillField(700, 700, 13);
  const HeightField island = MakeField(2800, 2800, [&](int x, int y) {
    return x >= 700 && x < 1400 && y >= 700 && y < 1400 ? land.At(x - 700, y - 700) : 0.0F;
  });
  EXPECT_EQ(FieldPartition::For(land, 6).size(), 9u);
  EXPECT_EQ(FieldPartition::For(island, 6).size(), 121u);
}

TEST(FieldPartition, StopsWhenAsked) {
  const HeightField field = HillField(70, 40, 11);
  std::stop_source source;
  source.request_stop();
  EXPECT_FALSE(MeshBlock(field, {0, 0, 35, 40}, 0, {}, source.get_token()));
}

TEST(RealFields, ACutTakesNoMoreThanOneInAHundredVerticesMore) {
  for (const auto& [name, error] :
       {std::pair{"westUS.tif", 20.0}, {"westUS.tif", 5.0}, {"ntc.tif", 5.0}, {"crater.tif", 1.0}}) {
    if (!test_support::TestDataPath(name)) GTEST_SKIP() << test_support::MissingTestData(name);
    const auto raster = test_support::ReadTestRaster(name);
    const HeightField field = MakeField(raster->width, raster->height, [&](int x, int y) {
      return raster->heights[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster->width) +
                             static_cast<std::size_t>(x)];
    });
    const FieldPartition cut = FieldPartition::For(field, error);
    EXPECT_GT(cut.size(), 1u);
    const TinMesh mesh = MeshInBlocks(field, cut, error);
    EXPECT_LE(static_cast<double>(mesh.vertices.size()),
              1.01 * static_cast<double>(MeshWhole(field, error).vertices.size()))
        << name;
    EXPECT_TRUE(IsWithin(field, mesh, error));
    EXPECT_TRUE(CoversExactly(field, mesh));
  }
}

}  // namespace
}  // namespace terrace::tin
