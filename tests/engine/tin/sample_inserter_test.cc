#include "engine/tin/sample_inserter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/tin/greedy.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(InsertSamples, AppendsWhatIsNoVertexYet) {
  const HeightField field = HillField(33, 33, 2);
  GreedyTriangulation tin(field);
  EXPECT_TRUE(tin.Run({20}));
  const TinMesh coarse = tin.Mesh();
  std::vector<SamplePosition> samples;
  for (std::uint16_t i = 1; i < 32; ++i) samples.push_back({i, i});
  samples.push_back({5, 5});
  const TinMesh mesh = InsertSamples(coarse, samples);
  std::vector<SamplePosition> expected = coarse.vertices;
  for (const SamplePosition sample : samples) {
    if (std::find(expected.begin(), expected.end(), sample) == expected.end()) expected.push_back(sample);
  }
  EXPECT_EQ(mesh.vertices, expected);
  EXPECT_TRUE(CoversExactly(field, mesh));
  EXPECT_TRUE(IsDelaunay(mesh));
  for (const Side side : {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest}) {
    EXPECT_EQ(BorderVertices(field, mesh, side), BorderVertices(field, coarse, side));
  }
}

TEST(InsertSamples, KeepsAnyMeshAMesh) {
  // A fan of slivers, which is not Delaunay.
  TinMesh fan{{{0, 0}, {40, 0}, {40, 40}, {0, 40}}, {}};
  for (std::uint16_t y = 1; y < 40; ++y) fan.vertices.push_back({40, y});
  std::uint32_t before = 1;
  for (std::uint32_t v = 4; v < fan.vertices.size(); ++v) {
    fan.triangles.push_back({0, before, v});
    before = v;
  }
  fan.triangles.push_back({0, before, 2});
  fan.triangles.push_back({0, 2, 3});
  const HeightField field = NoiseField(41, 41, 1);
  ASSERT_TRUE(CoversExactly(field, fan));
  Random random(1);
  std::vector<SamplePosition> samples;
  for (int i = 0; i < 500; ++i) {
    samples.push_back(
        {static_cast<std::uint16_t>(1 + random.Below(39)), static_cast<std::uint16_t>(1 + random.Below(39))});
  }
  EXPECT_TRUE(CoversExactly(field, InsertSamples(fan, samples)));
}

TEST(DelaunayOf, TriangulatesTheSameVertices) {
  const HeightField field = HillField(65, 65, 3);
  GreedyOptions options;
  options.criterion = Criterion::kDataDependent;
  GreedyTriangulation tin(field, options);
  EXPECT_TRUE(tin.Run({5}));
  const TinMesh mesh = tin.Mesh(), delaunay = DelaunayOf(mesh);
  EXPECT_FALSE(IsDelaunay(mesh));
  EXPECT_EQ(delaunay.vertices, mesh.vertices);
  EXPECT_TRUE(CoversExactly(field, delaunay));
  EXPECT_TRUE(IsDelaunay(delaunay));
}

TEST(SampleInserter, GoesOnAsIfItBeganAnew) {
  const HeightField field = HillField(65, 65, 3);
  for (const Criterion criterion : {Criterion::kDelaunay, Criterion::kDataDependent}) {
    GreedyOptions options;
    options.criterion = criterion;
    GreedyTriangulation tin(field, options);
    EXPECT_TRUE(tin.Run({10}));
    TinMesh mesh = tin.Mesh(), anew = mesh;
    SampleInserter inserter;
    Random random(4);
    for (int round = 0; round < 20; ++round) {
      std::vector<SamplePosition> samples;
      for (int i = random.Below(12); i >= 0; --i) {
        samples.push_back(
            {static_cast<std::uint16_t>(1 + random.Below(63)), static_cast<std::uint16_t>(1 + random.Below(63))});
      }
      inserter.InsertInto(mesh, samples);
      anew = InsertSamples(anew, samples);
      ASSERT_EQ(mesh.vertices, anew.vertices) << round;
      ASSERT_EQ(mesh.triangles, anew.triangles) << round;
    }
    EXPECT_TRUE(CoversExactly(field, mesh));
  }
}

TEST(InsertSamples, DividesBorderEdges) {
  const HeightField field = HillField(33, 33, 2);
  GreedyTriangulation tin(field);
  EXPECT_TRUE(tin.Run({20}));
  Random random(6);
  std::vector<SamplePosition> samples;
  for (int i = 0; i < 60; ++i) {
    const auto along = static_cast<std::uint16_t>(random.Below(33)), across = static_cast<std::uint16_t>(32 * (i % 2));
    samples.push_back(i % 4 < 2 ? SamplePosition{along, across} : SamplePosition{across, along});
  }
  const TinMesh mesh = InsertSamples(tin.Mesh(), samples);
  EXPECT_TRUE(CoversExactly(field, mesh));
  EXPECT_TRUE(IsDelaunay(mesh));
  for (const SamplePosition sample : samples) {
    EXPECT_NE(std::find(mesh.vertices.begin(), mesh.vertices.end(), sample), mesh.vertices.end());
  }
}

TEST(InsertSamplesDeathTest, RefusesSamplesBesideTheMeshAndOtherMeshes) {
  const HeightField field = HillField(33, 33, 2);
  GreedyTriangulation tin(field);
  const SamplePosition beside{33, 4};
  EXPECT_DEATH(InsertSamples(tin.Mesh(), {&beside, 1}), "check failed");
  const SamplePosition inside{7, 9};
  SampleInserter inserter;
  TinMesh mesh = tin.Mesh(), other = mesh;
  inserter.InsertInto(mesh, {&inside, 1});
  EXPECT_DEATH(inserter.InsertInto(other, {&inside, 1}), "check failed");  // not the mesh that it returned last
}

}  // namespace
}  // namespace terrace::tin
