#include "engine/tin/decimate/drop_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <stop_token>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh_error.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/sample_inserter.h"
#include "engine/tin/scan/triangle_spans.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/support/test_data.h"

namespace terrace::tin {
namespace {

constexpr std::array<Side, 4> kSides = {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest};

TinMesh GreedyMesh(const HeightField& field, double error, const GreedyOptions& options = {}) {
  GreedyTriangulation tin(field, options);
  EXPECT_TRUE(tin.Run({error}));
  return tin.Mesh();
}

TinMesh Dropped(const HeightField& field, const TinMesh& mesh, const DropOptions& options) {
  const std::optional<TinMesh> dropped = DropVertices(field, mesh, options);
  TERRACE_CHECK(dropped.has_value());
  return *dropped;
}

// The vertices of `part` are some of `whole`'s, in the same order.
bool IsSubsequence(const TinMesh& part, const TinMesh& whole) {
  auto next = whole.vertices.begin();
  for (const SamplePosition p : part.vertices) {
    next = std::find(next, whole.vertices.end(), p);
    if (next == whole.vertices.end()) return false;
    ++next;
  }
  return true;
}

// The promises of the drop pass, in addition to the laws of all meshes.
testing::AssertionResult IsFairDrop(const HeightField& field, const TinMesh& before, const TinMesh& after,
                                    double bound) {
  if (!IsSubsequence(after, before)) return testing::AssertionFailure() << "vertices are new or in another order";
  for (const Side side : kSides) {
    if (BorderVertices(field, after, side) != BorderVertices(field, before, side))
      return testing::AssertionFailure() << "border " << static_cast<int>(side) << " changed";
  }
  if (const auto covers = CoversExactly(field, after); !covers) return covers;
  return IsWithin(field, after, bound);
}

TEST(DropVertices, KeepsTheBoundTheBorderAndTheOrder) {
  for (const double bound : {0.0, 0.3, 2.0, 9.0, 60.0}) {
    for (const HeightField& field : {HillField(65, 65, 1), NoiseField(40, 33, 2), StepField(30, 30, 50, 3)}) {
      const TinMesh greedy = GreedyMesh(field, bound);
      EXPECT_TRUE(IsFairDrop(field, greedy, Dropped(field, greedy, {.max_error = bound}), bound));
    }
  }
}

TEST(DropVertices, KeepsItsPromisesOnRandomFields) {
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    Random random(seed);
    const int width = 2 + random.Below(20), height = 2 + random.Below(20);
    const float scale = std::array{1.f, 1e30f, 1e-30f, 100.f}[seed % 4];
    const int levels = 2 + random.Below(6), voids = random.Below(2) * random.Below(8);
    const HeightField field = MakeField(width, height, [&](int x, int y) {
      if ((x > 0 || y > 0) && random.Below(12) < voids) return kVoid;
      return scale * (levels == 2 ? static_cast<float>(random.Unit()) : static_cast<float>(random.Below(levels)));
    });
    const double bound = random.Unit() * 0.8 * static_cast<double>(scale) * levels * random.Below(3) / 2;
    const TinMesh greedy = GreedyMesh(field, bound);
    ASSERT_TRUE(IsFairDrop(field, greedy, Dropped(field, greedy, {.max_error = bound}), bound)) << seed;
  }
}

TEST(DropVertices, IsNoWorseThanAMeshThatMissesTheBound) {
  const HeightField field = HillField(65, 65, 4);
  GreedyTriangulation tin(field);
  tin.Run({0, 400});
  const TinMesh greedy = tin.Mesh();
  const double was = MeasureError(field, greedy).max;
  const TinMesh dropped = Dropped(field, greedy, {.max_error = 0.9 * was});
  EXPECT_LT(dropped.vertices.size(), greedy.vertices.size());
  EXPECT_TRUE(IsFairDrop(field, greedy, dropped, was));
}

TEST(DropVertices, LeavesOfACliffItsEnds) {
  constexpr int kSide = 257;
  struct Cliff {
    int dx, dy;                 // downhill
    std::size_t before, after;  // vertices: at least, at most
  };
  for (const Cliff& c : {Cliff{1, 0, 200, 8}, {0, 1, 200, 8}, {3, 1, 300, 12}}) {
    const HeightField cliff = MakeField(
        kSide, kSide, [&](int x, int y) { return c.dx * x + c.dy * y < 128 * (c.dx + c.dy) + 1 ? 0.f : 100.f; });
    const TinMesh greedy = GreedyMesh(cliff, 5);
    const TinMesh dropped = Dropped(cliff, greedy, {.max_error = 5});
    EXPECT_GE(greedy.vertices.size(), c.before);
    EXPECT_LE(dropped.vertices.size(), c.after);
    EXPECT_TRUE(IsFairDrop(cliff, greedy, dropped, 5));
  }
}

TEST(DropVertices, FlattensWhatNoSampleNeeds) {
  for (const float height : {0.f, 1e30f, 1e-30f}) {
    const HeightField plane = MakeField(17, 17, [&](int, int) { return height; });
    const std::vector<SamplePosition> samples = {{3, 3}, {8, 5}, {12, 12}, {4, 9}, {8, 8}};
    const TinMesh mesh = InsertSamples(GreedyTriangulation(plane).Mesh(), samples);
    ASSERT_EQ(mesh.vertices.size(), 9u);
    EXPECT_EQ(Dropped(plane, mesh, {}).vertices.size(), 4u);
  }
}

TEST(DropVertices, KeepsASpike) {
  const HeightField spike = MakeField(33, 33, [](int x, int y) { return x == 9 && y == 20 ? 1e30f : 0.f; });
  const TinMesh greedy = GreedyMesh(spike, 1);
  const TinMesh dropped = Dropped(spike, greedy, {.max_error = 1});
  EXPECT_TRUE(IsFairDrop(spike, greedy, dropped, 1));
  EXPECT_EQ(std::count(dropped.vertices.begin(), dropped.vertices.end(), SamplePosition{9, 20}), 1);
}

TEST(DropVertices, LeavesStripsAsTheyAre) {
  for (const auto& [width, height] : {std::pair{2, 40}, {40, 2}, {2, 2}}) {
    const HeightField strip = NoiseField(width, height, 5);
    const TinMesh greedy = GreedyMesh(strip, 10);
    EXPECT_EQ(Dropped(strip, greedy, {.max_error = 10}).vertices, greedy.vertices);
  }
}

TEST(DropVertices, DropsSeedsInVoids) {
  const HeightField field = MakeField(
      17, 17, [](int x, int y) { return x > 4 && x < 12 && y > 4 && y < 12 ? kVoid : static_cast<float>(x); });
  const std::vector<SamplePosition> samples = {{8, 8}, {7, 9}};
  const TinMesh mesh = InsertSamples(GreedyTriangulation(field).Mesh(), samples);
  EXPECT_EQ(Dropped(field, mesh, {.max_error = 0.5}).vertices.size(), 4u);
}

TEST(DropVertices, LeavesNothingToDrop) {
  const HeightField field = HillField(97, 97, 6);
  const TinMesh once = Dropped(field, GreedyMesh(field, 4), {.max_error = 4});
  const TinMesh twice = Dropped(field, once, {.max_error = 4});
  EXPECT_EQ(once.vertices, twice.vertices);
}

TEST(DropVertices, DependsOnTheGeometryAlone) {
  const HeightField field = HillField(65, 65, 7);
  const TinMesh greedy = GreedyMesh(field, 3);
  const TinMesh expected = Dropped(field, greedy, {.max_error = 3});
  Random random(8);
  TinMesh shuffled = greedy;
  for (std::size_t i = shuffled.triangles.size(); i-- > 1;) {
    std::swap(shuffled.triangles[i], shuffled.triangles[static_cast<std::size_t>(random.Below(static_cast<int>(i)))]);
    std::rotate(shuffled.triangles[i].begin(), shuffled.triangles[i].begin() + random.Below(3),
                shuffled.triangles[i].end());
  }
  const TinMesh dropped = Dropped(field, shuffled, {.max_error = 3});
  EXPECT_EQ(dropped.vertices, expected.vertices);
  EXPECT_EQ(dropped.triangles, expected.triangles);
}

TEST(DropVertices, CountsTheSagitta) {
  constexpr double kBound = 9;
  const HeightField field = HillField(65, 65, 9);
  const Curvature curvature{std::vector<double>(65, 900.0 * 900), 900.0 * 900, 6.378e6};
  GreedyOptions options;
  options.curvature = curvature;
  const TinMesh greedy = GreedyMesh(field, kBound, options);
  const TinMesh dropped = Dropped(field, greedy, {.max_error = kBound, .curvature = curvature});
  EXPECT_LT(dropped.vertices.size(), greedy.vertices.size());
  EXPECT_GT(dropped.vertices.size(), Dropped(field, greedy, {.max_error = kBound}).vertices.size());
  for (const auto& triangle : dropped.triangles) {
    std::array<Corner, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const SamplePosition p = dropped.vertices[triangle[i]];
      corners[i] = {p.x, p.y, static_cast<double>(field.VertexHeight(p.x, p.y))};
    }
    const double sagitta =
        Sagitta(curvature, field.height())
            .Bound(dropped.vertices[triangle[0]], dropped.vertices[triangle[1]], dropped.vertices[triangle[2]]);
    EXPECT_TRUE(SamplesAreWithin(field, corners, kBound - sagitta + 1e-9));
  }
}

TEST(DropVertices, TurnsNewTrianglesCounterClockwiseWhenQuantized) {
  constexpr int kSide = 65;
  const HeightField field = HillField(kSide, kSide, 11);
  const TinMesh greedy = GreedyMesh(field, 10);
  Random random(12);
  std::vector<std::uint16_t> columns, rows;  // displaced by far more than rounding would do
  for (int i = 0; i < kSide; ++i) {
    columns.push_back(static_cast<std::uint16_t>(10 * i + random.Below(25)));
    rows.push_back(static_cast<std::uint16_t>(10 * i + random.Below(25)));
  }
  const auto turned = [&](const TinMesh& mesh) {
    std::set<std::array<int, 6>> corners;
    for (const auto& [a, b, c] : mesh.triangles) {
      const SamplePosition p = mesh.vertices[a], q = mesh.vertices[b], r = mesh.vertices[c];
      const auto quantized = [&](SamplePosition s) { return SamplePosition{columns[s.x], rows[s.y]}; };
      if (Orientation(quantized(p), quantized(q), quantized(r)) > 0) continue;
      const std::array<Corner, 3> s = SortedByRow({Corner{p.x, p.y, 0}, {q.x, q.y, 0}, {r.x, r.y, 0}});
      corners.insert({s[0].x, s[0].y, s[1].x, s[1].y, s[2].x, s[2].y});
    }
    return corners;
  };
  const auto before = turned(greedy), blind = turned(Dropped(field, greedy, {.max_error = 10}));
  EXPECT_FALSE(std::includes(before.begin(), before.end(), blind.begin(), blind.end()));
  const TinMesh dropped =
      Dropped(field, greedy, {.max_error = 10, .quantized_columns = columns, .quantized_rows = rows});
  const auto after = turned(dropped);
  EXPECT_TRUE(std::includes(before.begin(), before.end(), after.begin(), after.end()));
  EXPECT_LT(dropped.vertices.size(), greedy.vertices.size());
  EXPECT_TRUE(IsFairDrop(field, greedy, dropped, 10));
}

TEST(DropVertices, ReturnsNothingWhenStopped) {
  const HeightField field = HillField(33, 33, 10);
  std::stop_source source;
  source.request_stop();
  EXPECT_FALSE(DropVertices(field, GreedyMesh(field, 2), {.max_error = 2}, source.get_token()));
}

TEST(DropVertices, SavesAThirdOfCraterLake) {
  const auto raster = test_support::ReadTestRaster("crater.tif");
  if (!raster) GTEST_SKIP() << test_support::MissingTestData("crater.tif");
  const auto crater = HeightField::Make(raster->width, raster->height, raster->heights);
  ASSERT_TRUE(crater.has_value());
  for (const auto& [error, share] : {std::pair{1.0, 0.32}, {5.0, 0.36}, {20.0, 0.41}}) {
    const TinMesh greedy = GreedyMesh(*crater, error);
    const TinMesh dropped = Dropped(*crater, greedy, {.max_error = error});
    EXPECT_TRUE(IsFairDrop(*crater, greedy, dropped, error));
    EXPECT_LE(static_cast<double>(dropped.vertices.size()), (1 - share) * static_cast<double>(greedy.vertices.size()));
  }
}

}  // namespace
}  // namespace terrace::tin
