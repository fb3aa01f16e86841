#include "tests/bench/parallel_insertion.h"

#include <gtest/gtest.h>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::bench {
namespace {

constexpr std::size_t kNoLimit = static_cast<std::size_t>(-1);

TEST(ParallelInsertion, WithAlphaOneIsSequential) {
  const tin::HeightField field = tin::NoiseField(21, 18, 3);  // all errors differ
  ParallelInsertion parallel(field);
  while (parallel.FractionalPass(1, 90) > 0) {
  }
  tin::GreedyTriangulation sequential(field);
  ASSERT_TRUE(sequential.Run({0, 90}));
  EXPECT_EQ(parallel.Mesh().vertices, sequential.Mesh().vertices);
}

TEST(ParallelInsertion, NaivePassesAreSequential) {
  const tin::HeightField field = tin::NoiseField(17, 22, 7);
  ParallelInsertion naive(field);
  while (naive.NaivePass(60) > 0) {
  }
  tin::GreedyTriangulation sequential(field);
  ASSERT_TRUE(sequential.Run({0, 60}));
  EXPECT_EQ(naive.Mesh().vertices, sequential.Mesh().vertices);
}

TEST(ParallelInsertion, WithAlphaZeroInsertsInEveryTriangle) {
  const tin::HeightField field = tin::NoiseField(40, 40, 4);
  ParallelInsertion parallel(field);
  EXPECT_EQ(parallel.FractionalPass(0, kNoLimit), 2u);  // the two halves of the square
  const std::size_t before = parallel.vertex_count(), triangles = parallel.Mesh().triangles.size();
  const std::size_t inserted = parallel.FractionalPass(0, kNoLimit);
  EXPECT_EQ(parallel.vertex_count(), before + inserted);
  EXPECT_LE(inserted, triangles);
  EXPECT_GT(inserted, triangles / 2);  // at most two triangles share a sample on their edge
}

TEST(ParallelInsertion, KeepsTheConstantThreshold) {
  const tin::HeightField field = tin::HillField(70, 50, 5);
  ParallelInsertion parallel(field);
  while (parallel.ConstantPass(10, kNoLimit) > 0) {
  }
  EXPECT_LT(parallel.CurrentError(), 10);
  const tin::TinMesh mesh = parallel.Mesh();
  EXPECT_LT(tin::MeasureError(field, mesh).max, 10 + 1e-9);
  EXPECT_TRUE(tin::CoversExactly(field, mesh));
  EXPECT_TRUE(tin::IsDelaunay(mesh));
}

TEST(ParallelInsertion, StopsAtItsVertices) {
  const tin::HeightField field = tin::HillField(70, 50, 6);
  ParallelInsertion parallel(field);
  while (parallel.FractionalPass(0.5, 100) > 0) {
  }
  EXPECT_EQ(parallel.vertex_count(), 100u);
}

}  // namespace
}  // namespace terrace::bench
