#include "tiler/mesh/inner_vertices.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "engine/tin/greedy.h"
#include "proto/mesh/tile_normals.h"
#include "tiler/mesh/tile_mesher.h"

namespace terrace::tiler {
namespace {

constexpr int kCells = 64;

// A tile with its halo, 40 m a cell, at 45 degrees north.
struct Ground {
  explicit Ground(const std::function<float(int, int)>& height) {
    for (int j = -1; j <= kCells + 1; ++j) {
      for (int i = -1; i <= kCells + 1; ++i) heights.push_back(height(i, j));
    }
  }
  proto::TileSamples view() const { return {key, {key.level, kCells}, heights}; }

  const geo::TileKey key{12, 4096, 3072};
  std::vector<float> heights;
};

tin::TinMesh MeshOf(const proto::TileSamples& samples, double error) {
  const tin::HeightField field = FieldOf(samples);
  tin::GreedyTriangulation greedy(field, {});
  tin::GreedyGoal goal;
  goal.max_error = error;
  greedy.Run(goal);
  return greedy.Mesh();
}

std::size_t Misfits(const proto::TileSamples& samples, const tin::TinMesh& mesh) {
  std::vector<geo::Vec3> positions;
  for (const tin::SamplePosition p : mesh.vertices) {
    positions.push_back(geo::ToEcef(samples.Longitude(p.x), samples.Latitude(p.y), samples.At(p.x, p.y)));
  }
  return proto::CountMisfits(mesh, positions, proto::VertexNormals(samples, mesh, positions));
}

// The last column of the tile is the end of a survey, level and 1,300 m above the rest.
TEST(InnerVertices, LightFitsATileThatHasTheRimOfARasterAlone) {
  const Ground ground([](int i, int) { return i >= kCells ? 1300.0F : 0.0F; });
  const proto::TileSamples samples = ground.view();
  const tin::TinMesh mesh = MeshOf(samples, 1400);
  ASSERT_GE(2 * Misfits(samples, mesh), mesh.vertices.size()) << "what this is for";
  const tin::TinMesh more = WithInnerVertices(samples, mesh);
  EXPECT_LT(2 * Misfits(samples, more), more.vertices.size());
  ASSERT_GE(more.vertices.size(), mesh.vertices.size());
  EXPECT_TRUE(std::equal(mesh.vertices.begin(), mesh.vertices.end(), more.vertices.begin())) << "they come first";
  const auto is_inside = [](tin::SamplePosition p) { return p.x > 0 && p.y > 0 && p.x < kCells && p.y < kCells; };
  EXPECT_TRUE(std::all_of(more.vertices.begin() + static_cast<std::ptrdiff_t>(mesh.vertices.size()),
                          more.vertices.end(), is_inside));
}

TEST(InnerVertices, ATileThatIsLitWellStaysAsItIs) {
  for (const auto& height :
       {std::function<float(int, int)>([](int, int) { return 7.0F; }),
        std::function<float(int, int)>([](int i, int j) { return static_cast<float>(3 * i + j); }),
        std::function<float(int, int)>([](int i, int j) { return static_cast<float>((i * 37 + j * 101) % 50); })}) {
    const Ground ground(height);
    const tin::TinMesh mesh = MeshOf(ground.view(), 5);
    EXPECT_EQ(WithInnerVertices(ground.view(), mesh).vertices.size(), mesh.vertices.size());
  }
}

}  // namespace
}  // namespace terrace::tiler
