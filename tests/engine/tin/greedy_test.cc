#include "engine/tin/greedy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/tin/mesh_error.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/naive_greedy.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

// The same triangles, in any order and with any first corner.
testing::AssertionResult AreSameMesh(TinMesh a, TinMesh b) {
  for (TinMesh* mesh : {&a, &b}) {
    for (auto& triangle : mesh->triangles) {
      std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
    }
    std::sort(mesh->triangles.begin(), mesh->triangles.end());
  }
  return AreEqual(a, b);
}

TEST(Greedy, InsertsInTheOrderOfTheNaiveAlgorithm) {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    Random random(seed);
    const int width = 2 + random.Below(12), height = 2 + random.Below(12);
    // Odd seeds have steps, where nearly all choices are ties.
    const HeightField field = seed % 2 == 0 ? NoiseField(width, height, seed) : StepField(width, height, 4, seed);
    GreedyOptions options;
    for (BorderOptions& border : options.borders) {
      border = {.weight = 1 + random.Below(3) * 0.5,
                .padding_m = random.Below(2) * 0.5,
                .step_m = random.Below(2) * 0.75,
                .sagitta_m = random.Below(2) * 0.25};
    }
    const GreedyGoal goal{random.Below(2) * 1.0};
    ASSERT_TRUE(AreSameMesh(MeshAt(field, goal, options), NaiveGreedy(field, options.borders, goal))) << seed;
  }
}

TEST(Greedy, InsertsInTheOrderOfTheNaiveAlgorithmAroundVoids) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    Random random(seed);
    const HeightField field = MakeField(
        9, 11, [&](int, int) { return random.Below(3) == 0 ? kVoid : static_cast<float>(random.Unit() * 9); });
    ASSERT_TRUE(AreSameMesh(MeshAt(field, {0.5}), NaiveGreedy(field, {}, {0.5})));
  }
}

TEST(Greedy, KeepsTheBoundAtEverySample) {
  for (const double bound : {0.0, 0.3, 2.0, 9.0, 60.0}) {
    for (const HeightField& field : {HillField(65, 65, 1), NoiseField(40, 33, 2), StepField(30, 30, 50, 3)}) {
      const TinMesh mesh = MeshAt(field, {bound});
      EXPECT_TRUE(IsWithin(field, mesh, bound));
      EXPECT_TRUE(CoversExactly(field, mesh));
      EXPECT_TRUE(IsDelaunay(mesh));
    }
  }
}

TEST(Greedy, NeedsFourVerticesForAPlane) {
  const HeightField field = MakeField(17, 9, [](int x, int y) { return static_cast<float>(2 * x - 3 * y); });
  EXPECT_EQ(MeshAt(field, {0}).vertices.size(), 4u);
  EXPECT_EQ(MeshAt(MakeField(33, 33, [](int, int) { return 1e30f; }), {0}).vertices.size(), 4u);
  EXPECT_EQ(MeshAt(MakeField(33, 33, [](int, int) { return 1e-30f; }), {0}).vertices.size(), 4u);
}

TEST(Greedy, SurvivesExtremeHeights) {
  const float largest = std::numeric_limits<float>::max(), smallest = std::numeric_limits<float>::denorm_min();
  for (const float scale : {1e30f, 1e-30f, largest / 2, smallest}) {
    Random random(1);
    const HeightField field =
        MakeField(20, 20, [&](int, int) { return static_cast<float>(random.Below(3) - 1) * scale; });
    GreedyTriangulation tin(field);
    EXPECT_TRUE(tin.Run(
        {static_cast<double>(scale) / 4, std::numeric_limits<std::size_t>::max(), static_cast<double>(scale) / 8}));
    const MeshError error = MeasureError(field, tin.Mesh());
    EXPECT_TRUE(std::isfinite(error.max) && std::isfinite(error.rms));
    EXPECT_TRUE(error.max <= static_cast<double>(scale) / 4 * (1 + 1e-9) ||
                error.rms <= static_cast<double>(scale) / 8 * (1 + 1e-9));
  }
}

TEST(Greedy, CatchesSpikesCliffsAndStrips) {
  const HeightField spike = MakeField(33, 33, [](int x, int y) { return x == 20 && y == 7 ? 500.f : 10.f; });
  const HeightField cliff = MakeField(33, 33, [](int x, int y) { return x > 14 + y % 3 ? 300.f : 0.f; });
  const HeightField strip = NoiseField(2, 200, 4), flat_strip = NoiseField(200, 2, 5), row = NoiseField(3, 50, 6);
  for (const HeightField* field : {&spike, &cliff, &strip, &flat_strip, &row}) {
    for (const double bound : {0.0, 1.0, 20.0}) {
      const TinMesh mesh = MeshAt(*field, {bound});
      EXPECT_TRUE(IsWithin(*field, mesh, bound));
      EXPECT_TRUE(CoversExactly(*field, mesh));
      EXPECT_TRUE(IsDelaunay(mesh));
    }
  }
  const TinMesh smallest = MeshAt(NoiseField(2, 2, 1), {0});
  EXPECT_EQ(smallest.triangles.size(), 2u);
}

TEST(Greedy, TakesEverySampleAtErrorZero) {
  const HeightField field = NoiseField(23, 19, 8);
  EXPECT_EQ(MeshAt(field, {0}).vertices.size(), 23u * 19u);
}

TEST(Greedy, NeverMakesAnInteriorVoidAVertex) {
  Random random(2);
  const HeightField field = MakeField(40, 40, [&](int x, int y) {
    return (x - 20) * (x - 20) + (y - 15) * (y - 15) < 90 || random.Below(9) == 0 ? kVoid : HillHeight(x, y, 3);
  });
  const TinMesh mesh = MeshAt(field, {1});
  EXPECT_TRUE(IsWithin(field, mesh, 1));
  EXPECT_TRUE(CoversExactly(field, mesh));
  for (std::size_t i = 4; i < mesh.vertices.size(); ++i)
    EXPECT_FALSE(std::isnan(field.At(mesh.vertices[i].x, mesh.vertices[i].y)));
}

TEST(Greedy, StopsAtTheNumberOfPoints) {
  const HeightField field = HillField(65, 65, 5);
  for (const std::size_t points : {0u, 4u, 5u, 100u, 1000u}) {
    EXPECT_EQ(MeshAt(field, {0, points}).vertices.size(), std::max<std::size_t>(points, 4));
  }
}

TEST(Greedy, StopsAtTheFirstMeshWithinTheRootMeanSquare) {
  const HeightField hills = HillField(65, 65, 6);
  Random random(3);
  const HeightField holes =
      MakeField(50, 41, [&](int x, int y) { return random.Below(6) == 0 ? kVoid : HillHeight(x, y, 7); });
  for (const HeightField* field : {&hills, &holes}) {
    for (const double rms : {8.0, 3.0, 0.7}) {
      GreedyGoal goal;
      goal.rms_error = rms;
      const TinMesh mesh = MeshAt(*field, goal);
      EXPECT_LE(MeasureError(*field, mesh).rms, rms * (1 + 1e-12));
      const TinMesh one_less = MeshAt(*field, {0, mesh.vertices.size() - 1});
      EXPECT_GT(MeasureError(*field, one_less).rms, rms * (1 - 1e-12));
    }
  }
}

TEST(Greedy, GoesOnFromACoarserRunToTheMeshOfOneRun) {
  const HeightField field = HillField(65, 65, 9);
  GreedyOptions options;
  options.seeds = {{80, 32}, {30, 16}, {12, 8}, {3, 4}};
  options.borders.fill({.weight = 2, .padding_m = 0.1, .sagitta_m = 0.001});
  options.curvature = {std::vector<double>(65, 900.0), 1000.0, 6.4e4};
  for (const GreedyOptions& run_options : {GreedyOptions{}, options}) {
    GreedyTriangulation tin(field, run_options);
    for (const double error : {50.0, 20.0, 10.0, 5.0, 1.0}) {
      EXPECT_TRUE(tin.Run({error}));
      EXPECT_LE(tin.CurrentError(), error);
      EXPECT_TRUE(AreEqual(tin.Mesh(), MeshAt(field, {error}, run_options))) << error;
    }
    EXPECT_TRUE(tin.Run({10}));
    EXPECT_TRUE(AreEqual(tin.Mesh(), MeshAt(field, {1}, run_options)));
  }
  GreedyTriangulation tin(field, options);
  for (const std::size_t points : {6u, 50u, 90u, 91u, 400u, 700u}) {
    EXPECT_TRUE(tin.Run({0, points}));
    EXPECT_TRUE(AreEqual(tin.Mesh(), MeshAt(field, {0, points}, options))) << points;
  }
}

TEST(Greedy, InsertsSeedsBelowTheirErrorEvenWhereNothingIsOff) {
  const HeightField flat = MakeField(17, 17, [](int, int) { return 3.f; });
  GreedyOptions options;
  options.seeds = {{20, 8}, {5, 4}};
  EXPECT_EQ(MeshAt(flat, {20}, options).vertices.size(), 4u);
  EXPECT_EQ(MeshAt(flat, {19}, options).vertices.size(), 9u);
  EXPECT_EQ(MeshAt(flat, {5}, options).vertices.size(), 9u);
  const TinMesh all = MeshAt(flat, {1}, options);
  ASSERT_EQ(all.vertices.size(), 25u);
  EXPECT_EQ(all.vertices[4], (SamplePosition{8, 0}));
  EXPECT_EQ(all.vertices[5], (SamplePosition{0, 8}));
  EXPECT_EQ(all.vertices[9], (SamplePosition{4, 0}));
  EXPECT_TRUE(CoversExactly(flat, all));
  EXPECT_TRUE(IsDelaunay(all));
}

TEST(Greedy, RefinesCurvedGroundThatIsFlat) {
  const HeightField flat = MakeField(33, 33, [](int, int) { return 0.f; });
  GreedyOptions options;
  options.curvature = {std::vector<double>(33, 100.0), 100.0, 1024.0};
  const double whole = (32 * 32 + 32 * 32) * 100.0 / 4 / 2048;  // a float
  EXPECT_DOUBLE_EQ(GreedyTriangulation(flat, options).CurrentError(), whole);
  EXPECT_EQ(MeshAt(flat, {whole}, options).vertices.size(), 4u);
  const TinMesh mesh = MeshAt(flat, {whole / 8}, options);
  EXPECT_GT(mesh.vertices.size(), 8u);
  EXPECT_TRUE(CoversExactly(flat, mesh));
}

TEST(GreedyDeathTest, RefusesImpossibleOptions) {
  const HeightField field = HillField(33, 33, 2);
  GreedyOptions step_does_not_divide;
  step_does_not_divide.seeds = {{5, 5}};
  EXPECT_DEATH(GreedyTriangulation(field, step_does_not_divide), "check failed");
  GreedyOptions too_few_rows;
  too_few_rows.curvature = {std::vector<double>(32, 1.0), 1, 1};
  EXPECT_DEATH(GreedyTriangulation(field, too_few_rows), "check failed");
}

TEST(Greedy, StopsWhenAskedAndGoesOnLater) {
  const HeightField field = HillField(65, 65, 4);
  GreedyOptions options;
  options.seeds = {{1000, 16}};
  GreedyTriangulation tin(field, options);
  std::stop_source source;
  source.request_stop();
  EXPECT_FALSE(tin.Run({1}, source.get_token()));
  EXPECT_TRUE(CoversExactly(field, tin.Mesh()));
  EXPECT_TRUE(tin.Run({1}));
  EXPECT_TRUE(AreEqual(tin.Mesh(), MeshAt(field, {1}, options)));
}

TEST(Greedy, CanBeMoved) {
  const HeightField field = HillField(33, 33, 4);
  GreedyTriangulation first(field);
  EXPECT_TRUE(first.Run({10}));
  GreedyTriangulation second = std::move(first);
  EXPECT_TRUE(second.Run({2}));
  EXPECT_TRUE(AreEqual(second.Mesh(), MeshAt(field, {2})));
}

}  // namespace
}  // namespace terrace::tin
