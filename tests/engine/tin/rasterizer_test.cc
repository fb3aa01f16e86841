// Tests the rasterizer: it finds errors in meshes, and agrees with the engine's measurement of correct ones.
#include "tests/engine/tin/rasterizer.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <utility>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

// 5 x 5 samples, a spike of 8 m in the middle; four triangles that meet in a vertex there.
HeightField Spike() {
  return MakeField(5, 5, [](int x, int y) { return x == 2 && y == 2 ? 8.f : 0.f; });
}
TinMesh Fan() {
  return {{{0, 0}, {4, 0}, {4, 4}, {0, 4}, {2, 2}}, {{{0, 1, 4}}, {{1, 2, 4}}, {{2, 3, 4}}, {{3, 0, 4}}}};
}

TEST(Rasterizer, MeasuresTheWorstSample) {
  // The pyramid is 4 m high one row from the border.
  const Rasterization fan = Rasterize(Spike(), Fan());
  EXPECT_EQ(fan.max_error, 4);
  EXPECT_TRUE(Keeps(fan, 4));
  EXPECT_FALSE(Keeps(fan, 3.999));

  const Rasterization flat = Rasterize(Spike(), {{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{{0, 1, 2}}, {{2, 3, 0}}}});
  EXPECT_EQ(flat.max_error, 8);
  EXPECT_EQ(flat.worst, (SamplePosition{2, 2}));
}

TEST(Rasterizer, SeesAHole) {
  TinMesh mesh = Fan();
  mesh.triangles.pop_back();
  const Rasterization raster = Rasterize(Spike(), mesh);
  EXPECT_GT(raster.not_once, 0u);
  EXPECT_EQ(raster.open_edges, 2u);
  EXPECT_FALSE(raster.has_area_of_field);
  EXPECT_FALSE(Keeps(raster, 100));
}

TEST(Rasterizer, SeesATriangleTwice) {
  TinMesh mesh = Fan();
  mesh.triangles.push_back(mesh.triangles.front());
  const Rasterization raster = Rasterize(Spike(), mesh);
  EXPECT_GT(raster.not_once, 0u);
  EXPECT_EQ(raster.open_edges, 3u);
  EXPECT_FALSE(Keeps(raster, 100));
}

TEST(Rasterizer, SeesATriangleThatTurnedOver) {
  TinMesh mesh = Fan();
  std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
  const Rasterization raster = Rasterize(Spike(), mesh);
  EXPECT_EQ(raster.turned, 1u);
  EXPECT_FALSE(Keeps(raster, 100));
}

// Every sample is covered once and the area is right, but there is a crack where the heights differ.
TEST(Rasterizer, SeesAVertexInTheMiddleOfAnEdge) {
  const TinMesh mesh = {{{0, 0}, {4, 0}, {4, 4}, {0, 4}, {2, 2}}, {{{0, 1, 4}}, {{1, 2, 4}}, {{0, 2, 3}}}};
  const Rasterization raster = Rasterize(Spike(), mesh);
  EXPECT_EQ(raster.not_once, 0u);
  EXPECT_TRUE(raster.has_area_of_field);
  EXPECT_EQ(raster.open_edges, 3u);
  EXPECT_FALSE(Keeps(raster, 100));
}

TEST(Rasterizer, AgreesWithTheEnginesMeasure) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const HeightField field = HillField(40 + static_cast<int>(seed), 33, seed);
    GreedyTriangulation tin(field);
    EXPECT_TRUE(tin.Run({0, 20 + 10 * seed}));
    const Rasterization raster = Rasterize(field, tin.Mesh());
    const MeshError measured = MeasureError(field, tin.Mesh());
    EXPECT_NEAR(raster.max_error, measured.max, 1e-12 * raster.magnitude);
    EXPECT_TRUE(Keeps(raster, measured.max));
  }
}

}  // namespace
}  // namespace terrace::tin
