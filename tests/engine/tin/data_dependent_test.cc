#include "engine/tin/data_dependent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "engine/tin/border.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/quadrilateral.h"
#include "engine/tin/mesh_error.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/scan/triangle_spans.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/support/test_data.h"

namespace terrace::tin {
namespace {

constexpr std::array kMeasures = {FitMeasure::kSumMax, FitMeasure::kSumSquares, FitMeasure::kMaxMax,
                                  FitMeasure::kNormals};

GreedyOptions DataDependent(FitMeasure measure = FitMeasure::kSumMax, double qthresh = 0.5) {
  GreedyOptions options;
  options.criterion = Criterion::kDataDependent;
  options.data_dependent = {measure, qthresh};
  return options;
}

HeightField FieldWithVoids(int width, int height, std::uint64_t seed) {
  Random random(seed);
  return MakeField(width, height, [&](int x, int y) {
    return random.Below(5) == 0 || (x - 9) * (x - 9) + (y - 7) * (y - 7) < 12 ? kVoid : HillHeight(x, y, seed);
  });
}

// Triangles, each starting at its smallest vertex, sorted; independent of slots.
std::set<std::array<VertexId, 3>> TrianglesOf(const TinMesh& mesh) {
  std::set<std::array<VertexId, 3>> triangles;
  for (std::array<VertexId, 3> triangle : mesh.triangles) {
    std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
    triangles.insert(triangle);
  }
  return triangles;
}

testing::AssertionResult HaveTheSameTriangles(const TinMesh& a, const TinMesh& b) {
  if (a.vertices != b.vertices) {
    return testing::AssertionFailure() << a.vertices.size() << " and " << b.vertices.size() << " vertices";
  }
  if (TrianglesOf(a) != TrianglesOf(b)) return testing::AssertionFailure() << "triangles differ";
  return testing::AssertionSuccess();
}

// Data-dependent greedy insertion without optimizations: no queue, no cached fit, complete tests, and a scan of all
// samples of the field for every triangle.
class NaiveDataDependent {
 public:
  NaiveDataDependent(const HeightField& field, DataDependentOptions options)
      : field_(field), options_(options), triangulation_(field) {}

  TinMesh Mesh() const { return triangulation_.Mesh(); }

  void Insert(SamplePosition at) { Insert(SampleNumber(at.x, at.y), triangulation_.Locate(at, 0)); }
  void InsertDelaunay(SamplePosition at) {
    triangulation_.InsertDelaunay(Triangulation::VertexAt(field_, at.x, at.y), triangulation_.Locate(at, 0));
  }

  TinMesh Run(double max_error) {
    for (;;) {
      Candidate worst;
      TriangleId at = 0;
      for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) {
        const auto [a, b, c] = triangulation_.triangle(t);
        Candidate candidate = WorstInside(At(a), At(b), At(c));
        if (const Candidate border = WorstBorder(At(a), At(b), At(c)); Precedes(border, candidate)) candidate = border;
        candidate.error = static_cast<double>(CandidateQueue::RoundUp(candidate.error));
        if (Precedes(candidate, worst)) {
          worst = candidate;
          at = t;
        }
      }
      if (worst.error <= max_error) return triangulation_.Mesh();
      Insert(worst.sample, at);
    }
  }

 private:
  Corner At(VertexId vertex) const {
    const SamplePosition p = triangulation_.position(vertex);
    return {p.x, p.y, static_cast<double>(triangulation_.height(vertex))};
  }

  Candidate WorstInside(const Corner& a, const Corner& b, const Corner& c) const {
    const double ux = a.x - c.x, uy = a.y - c.y, vx = b.x - c.x, vy = b.y - c.y;
    const double d = ux * vy - uy * vx;
    const double per_x = vy * (a.z - c.z) - uy * (b.z - c.z), per_y = ux * (b.z - c.z) - vx * (a.z - c.z);
    double furthest = -1;
    std::uint32_t sample = kNoSample;
    for (int y = 0; y < field_.height(); ++y) {
      for (int x = 0; x < field_.width(); ++x) {
        const double px = x - c.x, py = y - c.y;
        const double of_a = px * vy - py * vx, of_b = ux * py - uy * px;
        if (of_a < 0 || of_b < 0 || d - of_a - of_b < 0) continue;
        const bool is_border = x == 0 || y == 0 || x + 1 == field_.width() || y + 1 == field_.height();
        const bool is_corner = of_a == d || of_b == d || (of_a == 0 && of_b == 0);
        if (is_border || is_corner) continue;
        const auto height = static_cast<double>(field_.At(x, y));
        const double numerator = std::abs(d * (height - c.z) - (per_x * px + per_y * py));
        if (!(numerator > furthest)) continue;
        furthest = numerator;
        sample = SampleNumber(x, y);
      }
    }
    return {std::max(furthest, 0.0) / d, sample};
  }

  Candidate WorstBorder(const Corner& a, const Corner& b, const Corner& c) const {
    Candidate worst;
    const int east = field_.width() - 1, north = field_.height() - 1;
    for (const auto& [p, q] : {std::pair(a, b), {b, c}, {c, a}}) {
      const bool on_border = (p.x == q.x && (p.x == 0 || p.x == east)) || (p.y == q.y && (p.y == 0 || p.y == north));
      if (!on_border) continue;
      if (const Candidate on_edge = WorstBorderSample(field_, p, q, {}); Precedes(on_edge, worst)) worst = on_edge;
    }
    return worst;
  }

  double Error(const Corner& a, const Corner& b, const Corner& c) const {
    if (options_.measure == FitMeasure::kSumSquares) return SquaredDistances(field_, {a, b, c});
    return std::max(WorstInside(a, b, c).error, WorstBorder(a, b, c).error);
  }

  enum class Verdict { kKeeps, kTakesByShape, kTakesByFit };
  Verdict Judge(const Quadrilateral& q, const Corner& p, TriangleId beyond, bool is_further_out) const {
    const double threshold = options_.qthresh, root = std::sqrt(std::sqrt(threshold));
    ShapeQuality quality = Quality(q);
    if (options_.measure == FitMeasure::kNormals) {
      quality.uv *= quality.uv;
      quality.pw *= quality.pw;
    }
    if (quality.uv < threshold * threshold * quality.pw) return Verdict::kTakesByShape;
    if (quality.pw < (is_further_out ? root : threshold * root) * quality.uv) return Verdict::kKeeps;
    double now = 0, then = 0;  // squared
    if (options_.measure == FitMeasure::kNormals) {
      now = NormalAnglesOf(q).uv;
      then = NormalAnglesOf(q).pw;
    } else {
      const auto [a, b, c] = triangulation_.triangle(beyond);
      const Corner u = At(q.u.id), v = At(q.v.id), w = At(q.w.id);
      now = Square(Error(u, v, p), Error(At(a), At(b), At(c)));
      then = Square(Error(u, w, p), Error(w, v, p));
    }
    if (threshold > 0) {
      now *= quality.pw;
      then *= quality.uv;
    }
    return then < now || (then == now && quality.pw >= quality.uv) ? Verdict::kTakesByFit : Verdict::kKeeps;
  }

  // Squared qualities, triangle by triangle.
  static ShapeQuality Quality(const Quadrilateral& q) {
    const auto area = [](const RingVertex& a, const RingVertex& b, const RingVertex& c) {
      return static_cast<double>((b.dx - a.dx) * (c.dy - a.dy) - (b.dy - a.dy) * (c.dx - a.dx));
    };
    const auto diameter = [](const RingVertex& a, const RingVertex& b, const RingVertex& c) {
      const int width = std::max({a.dx, b.dx, c.dx}) - std::min({a.dx, b.dx, c.dx});
      const int height = std::max({a.dy, b.dy, c.dy}) - std::min({a.dy, b.dy, c.dy});
      return 4.0 * std::max(width, height) + std::min(width, height);
    };
    const RingVertex p;
    const auto& [u, v, w, height] = q;
    return {area(p, u, v) * area(v, u, w) * (diameter(p, u, w) * diameter(p, w, v)),
            area(p, u, w) * area(p, w, v) * (diameter(p, u, v) * diameter(v, u, w))};
  }

  double Square(double a, double b) const {
    if (options_.measure == FitMeasure::kSumSquares) return a + b;
    const double combined = options_.measure == FitMeasure::kMaxMax ? std::max(a, b) : a + b;
    return combined * combined;
  }

  void Insert(std::uint32_t sample, TriangleId triangle) {
    const SamplePosition at = PositionOf(sample);
    const float height = field_.At(at.x, at.y);
    const Corner p{at.x, at.y, static_cast<double>(height)};
    std::set<std::pair<VertexId, VertexId>> further_out;  // edges that a flip decided by fit added to the outline
    triangulation_.Insert(
        {at, height}, triangle, [&](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back) {
          if (Cross(u, v) == 0) return true;
          if (!Sees(u, v, w)) return false;
          const bool is_further_out = further_out.contains({u.id, v.id});
          const Verdict verdict = Judge({u, v, w, height}, p, back / 4, is_further_out);
          // With normals there are only the tests of the walk.
          if (options_.measure != FitMeasure::kNormals && (verdict == Verdict::kTakesByFit || is_further_out)) {
            further_out.insert({{u.id, w.id}, {w.id, v.id}});
          }
          return verdict != Verdict::kKeeps;
        });
  }

  const HeightField& field_;
  DataDependentOptions options_;
  Triangulation triangulation_;
};

TEST(DataDependent, ChoosesAsTheFullTestOfEveryQuadrilateral) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const int width = 3 + random.Below(14), height = 3 + random.Below(14);
    const HeightField field = seed % 4 == 0   ? NoiseField(width, height, seed)
                              : seed % 4 == 1 ? StepField(width, height, 3, seed)
                              : seed % 4 == 2 ? HillField(width, height, seed)
                                              : FieldWithVoids(width, height, seed);
    for (const FitMeasure measure : kMeasures) {
      for (const double qthresh : {0.0, 0.5, 1.0}) {
        ASSERT_TRUE(HaveTheSameTriangles(MeshAt(field, {0.5}, DataDependent(measure, qthresh)),
                                         NaiveDataDependent(field, {measure, qthresh}).Run(0.5)))
            << seed << ", measure " << static_cast<int>(measure) << ", " << qthresh;
      }
    }
  }
}

// Between 0 and 1 both shape and fit decide tests, and the cached fit of a triangle must not be used for the triangle
// that replaces it.
TEST(DataDependent, ChoosesAsTheFullTestWhereShapeAndFitTakeTurns) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const int width = 8 + random.Below(20), height = 8 + random.Below(20);
    const HeightField field = seed % 2 == 0 ? StepField(width, height, 3, seed) : HillField(width, height, seed);
    const FitMeasure measure = seed % 3 == 0 ? kMeasures[seed / 3 % 4] : FitMeasure::kSumSquares;
    const double qthresh = seed % 5 == 0 ? 0.8 : 0.3;
    ASSERT_TRUE(HaveTheSameTriangles(MeshAt(field, {0.5}, DataDependent(measure, qthresh)),
                                     NaiveDataDependent(field, {measure, qthresh}).Run(0.5)))
        << seed << ", measure " << static_cast<int>(measure) << ", " << qthresh;
  }
}

// Concentric rings of vertices, then their centre: the innermost ring becomes the outline, and the fit decides the
// tests of its edges and of the edges beyond. There are more pairs than one scan can take, in the first round and in
// later ones.
TEST(DataDependent, ChoosesAsTheFullTestOfOutlinesOfManyEdges) {
  constexpr int kMiddle = 80, kEdges = 140;
  std::vector<SamplePosition> rings;
  for (const auto& [radius, turn] : {std::pair(64.0, 0.0), {68.0, 0.5}, {72.0, 0.0}}) {
    for (int i = 0; i < kEdges; ++i) {
      const double angle = (i + turn) * 2 * std::numbers::pi / kEdges;
      const SamplePosition at{static_cast<std::uint16_t>(std::lround(kMiddle + radius * std::cos(angle))),
                              static_cast<std::uint16_t>(std::lround(kMiddle + radius * std::sin(angle)))};
      if (std::find(rings.begin(), rings.end(), at) == rings.end()) rings.push_back(at);
    }
  }
  int wide_outlines = 0;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const HeightField field = HillField(2 * kMiddle + 1, 2 * kMiddle + 1, seed);
    const Sagitta flat({}, field.height());
    for (const FitMeasure measure : kMeasures) {
      for (const double qthresh : {0.0, 0.2, 0.45}) {
        Triangulation triangulation(field);
        NaiveDataDependent naive(field, {measure, qthresh});
        for (const SamplePosition at : rings) {
          triangulation.InsertDelaunay(Triangulation::VertexAt(field, at.x, at.y), triangulation.Locate(at, 0));
          naive.InsertDelaunay(at);
        }
        DataDependentCriterion criterion(field, flat, triangulation, {measure, qthresh});
        const SamplePosition middle{kMiddle, kMiddle};
        const Star& star =
            criterion.Insert(Triangulation::VertexAt(field, kMiddle, kMiddle), triangulation.Locate(middle, 0));
        naive.Insert(middle);
        EXPECT_TRUE(HaveTheSameTriangles(triangulation.Mesh(), naive.Mesh()))
            << seed << ", measure " << static_cast<int>(measure) << ", " << qthresh;
        wide_outlines += star.count >= kEdges / 2 ? 1 : 0;
      }
    }
  }
  EXPECT_GE(wide_outlines, 40);
}

TEST(DataDependent, KeepsTheBoundAtEverySampleByEveryMeasure) {
  const HeightField fields[] = {HillField(65, 65, 1), NoiseField(40, 33, 2), StepField(30, 30, 50, 3),
                                FieldWithVoids(40, 40, 4)};
  for (const FitMeasure measure : kMeasures) {
    for (const double qthresh : {0.0, 0.5, 1.0}) {
      for (const HeightField& field : fields) {
        for (const double bound : {0.0, 0.3, 9.0, 60.0}) {
          const TinMesh mesh = MeshAt(field, {bound}, DataDependent(measure, qthresh));
          EXPECT_TRUE(IsWithin(field, mesh, bound));
          EXPECT_TRUE(CoversExactly(field, mesh));
        }
      }
    }
  }
}

TEST(DataDependent, KeepsTheBoundOnRandomFields) {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    Random random(seed);
    const int width = 2 + random.Below(20), height = 2 + random.Below(20), range = 1 + random.Below(40);
    const HeightField field = StepField(width, height, range, seed);
    const double bound = random.Below(4) * 0.125 * range;
    const TinMesh mesh = MeshAt(field, {bound}, DataDependent(kMeasures[seed % 4], random.Unit()));
    ASSERT_TRUE(IsWithin(field, mesh, bound)) << seed;
    ASSERT_TRUE(CoversExactly(field, mesh)) << seed;
  }
}

TEST(DataDependent, CatchesSpikesCliffsAndStrips) {
  const HeightField spike = MakeField(33, 33, [](int x, int y) { return x == 20 && y == 7 ? 500.f : 10.f; });
  const HeightField cliff = MakeField(33, 33, [](int x, int y) { return x > 14 + y % 3 ? 300.f : 0.f; });
  const HeightField strip = NoiseField(2, 200, 4), flat_strip = NoiseField(200, 2, 5), row = NoiseField(3, 50, 6);
  for (const HeightField* field : {&spike, &cliff, &strip, &flat_strip, &row}) {
    for (const FitMeasure measure : kMeasures) {
      for (const double bound : {0.0, 1.0, 20.0}) {
        const TinMesh mesh = MeshAt(*field, {bound}, DataDependent(measure));
        EXPECT_TRUE(IsWithin(*field, mesh, bound));
        EXPECT_TRUE(CoversExactly(*field, mesh));
      }
    }
  }
}

TEST(DataDependent, SurvivesExtremeHeights) {
  const float largest = std::numeric_limits<float>::max(), smallest = std::numeric_limits<float>::denorm_min();
  for (const FitMeasure measure : kMeasures) {
    for (const float scale : {1e30f, 1e-30f, largest / 2, smallest}) {
      Random random(1);
      const HeightField field =
          MakeField(20, 20, [&](int, int) { return static_cast<float>(random.Below(3) - 1) * scale; });
      const double bound = static_cast<double>(scale) / 4;
      const TinMesh mesh = MeshAt(field, {bound}, DataDependent(measure));
      EXPECT_LE(MeasureError(field, mesh).max, bound * (1 + 1e-9));
      EXPECT_TRUE(CoversExactly(field, mesh));
    }
  }
}

TEST(DataDependent, TakesTheSameBorderVerticesAsDelaunay) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const HeightField field = seed % 2 == 0 ? HillField(65, 49, seed) : StepField(33, 40, 30, seed);
    for (const FitMeasure measure : kMeasures) {
      GreedyOptions options = DataDependent(measure);
      options.borders.fill({1.25, 0.0005, 0.125});
      for (const double bound : {1.0, 4.0, 20.0}) {
        const TinMesh mesh = MeshAt(field, {bound}, options);
        GreedyOptions delaunay = options;
        delaunay.criterion = Criterion::kDelaunay;
        const TinMesh other = MeshAt(field, {bound}, delaunay);
        for (const Side side : {Side::kSouth, Side::kEast, Side::kNorth, Side::kWest}) {
          EXPECT_EQ(BorderVertices(field, mesh, side), BorderVertices(field, other, side));
        }
      }
    }
  }
}

GreedyOptions WithSeedsAndCurvature(GreedyOptions options) {
  options.seeds = {{80, 32}, {30, 16}, {12, 8}, {3, 4}};
  options.borders.fill({2, 0.001});
  options.curvature = {std::vector<double>(65, 900.0), 1000.0, 6.4e4};
  return options;
}

TEST(DataDependent, GoesOnFromACoarserRunToTheMeshOfOneRun) {
  const HeightField field = HillField(65, 65, 9);
  for (const FitMeasure measure : kMeasures) {
    for (const GreedyOptions& options : {DataDependent(measure), WithSeedsAndCurvature(DataDependent(measure))}) {
      GreedyTriangulation tin(field, options);
      for (const double error : {50.0, 20.0, 10.0, 5.0, 1.0}) {
        EXPECT_TRUE(tin.Run({error}));
        EXPECT_LE(tin.CurrentError(), error);
        EXPECT_EQ(tin.Mesh().triangles, MeshAt(field, {error}, options).triangles) << error;
      }
    }
  }
}

TEST(DataDependent, ReplaysEveryPrefixOfARun) {
  for (const HeightField& field : {HillField(65, 65, 9), StepField(65, 65, 40, 2)}) {
    for (const FitMeasure measure : kMeasures) {
      for (GreedyOptions options : {DataDependent(measure), WithSeedsAndCurvature(DataDependent(measure))}) {
        options.record = true;
        GreedyTriangulation tin(field, options);
        EXPECT_TRUE(tin.Run({1}));
        const Refinement refinement = tin.MakeRefinement().value();
        EXPECT_TRUE(HaveTheSameTriangles(refinement.MeshOf(refinement.vertex_count()), tin.Mesh()));
        for (const double error : {50.0, 20.0, 10.0, 5.0}) {
          EXPECT_TRUE(HaveTheSameTriangles(refinement.MeshAt(error), MeshAt(field, {error}, options))) << error;
        }
      }
    }
  }
}

// The refinement renumbers slots.
TEST(DataDependent, ContinuesARefinementToTheRefinementOfOneRun) {
  for (const HeightField& field : {HillField(65, 65, 9), StepField(65, 65, 9, 2), FieldWithVoids(65, 65, 3)}) {
    for (const FitMeasure measure : kMeasures) {
      for (GreedyOptions options : {DataDependent(measure), WithSeedsAndCurvature(DataDependent(measure))}) {
        options.record = true;
        if (!options.seeds.empty() && field.has_voids()) continue;
        GreedyTriangulation coarse(field, options), fine(field, options);
        EXPECT_TRUE(coarse.Run({20}));
        EXPECT_TRUE(fine.Run({1}));
        GreedyTriangulation continued(field, options, coarse.MakeRefinement().value());
        EXPECT_TRUE(continued.Run({1}));
        EXPECT_TRUE(HaveTheSameTriangles(continued.Mesh(), fine.Mesh()));
        EXPECT_EQ(continued.MakeRefinement(), fine.MakeRefinement());
      }
    }
  }
}

TEST(DataDependent, StopsAtTheFirstMeshWithinTheRootMeanSquare) {
  const HeightField field = HillField(65, 65, 6);
  for (const double rms : {8.0, 3.0, 0.7}) {
    const TinMesh mesh = MeshAt(field, {0, std::numeric_limits<std::size_t>::max(), rms}, DataDependent());
    EXPECT_LE(MeasureError(field, mesh).rms, rms * (1 + 1e-12));
    EXPECT_TRUE(HaveTheSameTriangles(mesh, MeshAt(field, {0, mesh.vertices.size()}, DataDependent())));
    EXPECT_GT(MeasureError(field, MeshAt(field, {0, mesh.vertices.size() - 1}, DataDependent())).rms,
              rms * (1 - 1e-12));
  }
}

TEST(DataDependent, NeedsFewerVerticesThanDelaunay) {
  const HeightField hills = MakeField(129, 129, [](int x, int y) {
    return static_cast<float>(40 * std::sin((x + 2 * y) / 11.0) + 20 * std::cos((3 * x - y) / 17.0));
  });
  for (const double error : {1.0, 4.0}) {
    const auto delaunay = static_cast<double>(MeshAt(hills, {error}, {}).vertices.size());
    for (const FitMeasure measure : {FitMeasure::kSumMax, FitMeasure::kSumSquares, FitMeasure::kMaxMax}) {
      EXPECT_LT(static_cast<double>(MeshAt(hills, {error}, DataDependent(measure)).vertices.size()), 0.95 * delaunay);
    }
  }
}

TEST(DataDependent, IsAsCloseOnCraterLakeAsTheAuthorsProgram) {
  constexpr const char* kName = "crater.tif";
  if (!test_support::TestDataPath(kName)) GTEST_SKIP() << test_support::MissingTestData(kName);
  const std::optional<test_support::TestRaster> raster = test_support::ReadTestRaster(kName);
  ASSERT_TRUE(raster);
  const HeightField crater = MakeField(raster->width, raster->height, [&](int x, int y) {
    return raster->heights[static_cast<std::size_t>(y * raster->width + x)];
  });
  struct Column {
    FitMeasure measure;
    std::array<double, 4> rms;  // at 1542, 5000, 7711 and 20000 vertices
  };
  for (const auto& [measure, expected] : {Column{FitMeasure::kSumMax, {6.2564, 2.5224, 1.7434, 0.76026}},
                                          Column{FitMeasure::kSumSquares, {6.3631, 2.5081, 1.7445, 0.74759}},
                                          Column{FitMeasure::kMaxMax, {6.6430, 2.6140, 1.8270, 0.77380}},
                                          Column{FitMeasure::kNormals, {7.4442, 3.0737, 2.1425, 0.91195}}}) {
    GreedyTriangulation tin(crater, DataDependent(measure));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      constexpr std::array<std::size_t, 4> kPoints = {1542, 5000, 7711, 20000};
      EXPECT_TRUE(tin.Run({0, kPoints[i]}));
      const MeshError error = MeasureError(crater, tin.Mesh());
      EXPECT_LT(error.rms, expected[i]) << static_cast<int>(measure) << ' ' << kPoints[i];
      EXPECT_LE(error.max, tin.CurrentError());
    }
  }
}

TEST(DataDependentDeathTest, RefusesAQthreshOutsideItsRange) {
  const HeightField field = HillField(9, 9, 1);
  EXPECT_DEATH(GreedyTriangulation(field, DataDependent(FitMeasure::kSumMax, 1.5)), "check failed");
  EXPECT_DEATH(GreedyTriangulation(field, DataDependent(FitMeasure::kSumMax, std::nan(""))), "check failed");
}

}  // namespace
}  // namespace terrace::tin
