#include "engine/tin/refinement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/insertion_recorder.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

GreedyOptions Recorded(GreedyOptions options = {}) {
  options.record = true;
  return options;
}

// Seeds, curvature and borders as for tiles.
GreedyOptions TileOptions(int side) {
  GreedyOptions options = Recorded();
  options.seeds = {{80, (side - 1) / 2}, {30, (side - 1) / 4}, {12, (side - 1) / 8}};
  options.borders.fill({.weight = 1.0625, .padding_m = 0.1, .sagitta_m = 0.0005});
  options.curvature = {std::vector<double>(static_cast<std::size_t>(side), 900.0), 1000.0, 6.4e4};
  return options;
}

Refinement RefineTo(const HeightField& field, double error, const GreedyOptions& options) {
  GreedyTriangulation tin(field, options);
  EXPECT_TRUE(tin.Run({error}));
  return tin.MakeRefinement().value();
}

std::vector<HeightField> Fields() {
  std::vector<HeightField> fields;
  fields.push_back(HillField(65, 65, 1));
  fields.push_back(StepField(65, 65, 30, 2));
  Random random(3);
  fields.push_back(MakeField(65, 65, [&](int x, int y) {
    return random.Below(5) == 0 ? std::numeric_limits<float>::quiet_NaN() : HillHeight(x, y, 3);
  }));
  return fields;
}

TEST(Refinement, HasEveryCoarserMesh) {
  for (const HeightField& field : Fields()) {
    for (const GreedyOptions& options : {Recorded(), TileOptions(65)}) {
      const Refinement finest = RefineTo(field, 0.5, options);
      for (const double error : {1e9, 100.0, 40.0, 20.0, 11.0, 5.0, 2.0, 1.0, 0.5}) {
        const Refinement coarse = RefineTo(field, error, options);
        EXPECT_EQ(finest.PointsAt(error), coarse.vertex_count());
        const TinMesh mesh = finest.MeshAt(error);
        EXPECT_TRUE(AreEqual(mesh, coarse.MeshOf(coarse.vertex_count())));
        EXPECT_TRUE(CoversExactly(field, mesh));
        EXPECT_TRUE(IsDelaunay(mesh));
        if (options.seeds.empty()) {
          EXPECT_TRUE(IsWithin(field, mesh, error));
        }
      }
    }
  }
}

TEST(Refinement, HasTheTrianglesOfTheRun) {
  const HeightField field = HillField(65, 65, 4);
  GreedyTriangulation tin(field, Recorded());
  EXPECT_TRUE(tin.Run({3}));
  const TinMesh replayed = tin.MakeRefinement()->MeshAt(3), run = tin.Mesh();
  EXPECT_EQ(replayed.vertices, run.vertices);
  const auto sorted = [](TinMesh mesh) {
    for (auto& triangle : mesh.triangles) {
      std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
    }
    std::sort(mesh.triangles.begin(), mesh.triangles.end());
    return mesh.triangles;
  };
  EXPECT_EQ(sorted(replayed), sorted(run));
}

TEST(Refinement, GoesOnAsIfItHadNeverStopped) {
  for (const HeightField& field : Fields()) {
    for (const GreedyOptions& options : {Recorded(), TileOptions(65)}) {
      const Refinement whole = RefineTo(field, 1, options);
      for (const double error : {60.0, 25.0, 8.0, 2.0}) {
        const Refinement first = RefineTo(field, error, options);
        GreedyTriangulation tin(field, options, first);
        EXPECT_TRUE(tin.Run({1}));
        EXPECT_EQ(tin.MakeRefinement(), whole) << error;
      }
    }
  }
}

TEST(Refinement, HasAsManyVerticesAsSixteenBitsAllow) {
  const HeightField field = NoiseField(260, 260, 1);
  GreedyTriangulation tin(field, Recorded());
  EXPECT_TRUE(tin.Run({.max_points = Refinement::kMaxVertices}));
  const std::optional<Refinement> largest = tin.MakeRefinement();
  ASSERT_TRUE(largest);
  ASSERT_EQ(largest->vertex_count(), Refinement::kMaxVertices);
  EXPECT_TRUE(CoversExactly(field, largest->MeshOf(Refinement::kMaxVertices)));
  EXPECT_LT(static_cast<double>(largest->bytes()) / static_cast<double>(largest->vertex_count()), 40);
  EXPECT_EQ(Refinement::Parse(largest->Serialize()).value(), *largest);
  EXPECT_TRUE(tin.Run({.max_points = Refinement::kMaxVertices + 1}));
  EXPECT_FALSE(tin.MakeRefinement());
}

TEST(Refinement, IsNoneIfAStarHasMoreTrianglesThanAnEntryHolds) {
  Star star;
  star.count = Refinement::kMaxStar + 1;
  star.removed_count = star.count - 2;
  star.ring.Grow(star.count + 1);
  star.triangles.resize(star.ring.ids.size());
  InsertionRecorder recorder(1);
  recorder.Append({1, 1}, 5, star);
  EXPECT_FALSE(recorder.Make(3, 3));
}

TEST(Refinement, SurvivesSerialization) {
  for (const HeightField& field : Fields()) {
    const Refinement refinement = RefineTo(field, 2, TileOptions(65));
    const std::string bytes = refinement.Serialize();
    const Result<Refinement> parsed = Refinement::Parse(bytes);
    ASSERT_TRUE(parsed.has_value()) << parsed.error().message;
    EXPECT_EQ(*parsed, refinement);
    EXPECT_LT(static_cast<double>(bytes.size()), 40.0 * static_cast<double>(refinement.vertex_count()));
  }
  const Refinement empty = RefineTo(HillField(9, 9, 1), 1e9, Recorded());
  EXPECT_EQ(Refinement::Parse(empty.Serialize()).value(), empty);
}

TEST(Refinement, RefusesEverythingElse) {
  const std::string bytes = RefineTo(HillField(17, 17, 1), 5, Recorded()).Serialize();
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    ASSERT_FALSE(Refinement::Parse(std::string_view(bytes).substr(0, length)).has_value()) << length;
  }
  EXPECT_FALSE(Refinement::Parse(bytes + '\0').has_value());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    ASSERT_FALSE(Refinement::Parse(damaged).has_value()) << i;
  }
}

}  // namespace
}  // namespace terrace::tin
