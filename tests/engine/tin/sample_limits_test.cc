#include "engine/tin/sample_limits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/tin/decimate/drop_pass.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr int kLimitedSide = 65;

HeightField RoughField() {
  return MakeField(kLimitedSide, kLimitedSide, [](int x, int y) {
    return static_cast<float>(40 * std::sin(x * 0.31) * std::cos(y * 0.17) + (x * 7 + y * 13) % 5);
  });
}

// Ten times the weight in one box, a cap of 1.5 m in another that overlaps it, and a diagonal that is forced.
SampleLimits SomeLimits() {
  SampleLimits limits;
  limits.weights.assign(kLimitedSide * kLimitedSide, 1);
  limits.caps.assign(limits.weights.size(), std::numeric_limits<float>::infinity());
  limits.forced.assign(limits.weights.size(), 0);
  for (int y = 0; y < kLimitedSide; ++y) {
    for (int x = 0; x < kLimitedSide; ++x) {
      const auto k = static_cast<std::size_t>(y * kLimitedSide + x);
      if (x >= 10 && x <= 30 && y <= 20) limits.weights[k] = 10;
      if (x >= 25 && y >= 15 && y <= 40) limits.caps[k] = 1.5F;
      if (x == y) limits.forced[k] = 1;
    }
  }
  return limits;
}

// The height of a mesh at each sample, by brute force over all triangles.
double ErrorAt(const HeightField& field, const TinMesh& mesh, int x, int y) {
  double worst = std::numeric_limits<double>::infinity();
  for (const auto& [a, b, c] : mesh.triangles) {
    const SamplePosition p = mesh.vertices[a], q = mesh.vertices[b], r = mesh.vertices[c];
    const double area = (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    const double v = ((x - p.x) * (r.y - p.y) - (y - p.y) * (r.x - p.x)) / area;
    const double w = ((q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)) / area;
    if (v < 0 || w < 0 || v + w > 1) continue;
    const double height = field.At(p) + v * (field.At(q) - field.At(p)) + w * (field.At(r) - field.At(p));
    worst = std::min(worst, std::abs(height - static_cast<double>(field.At(x, y))));
  }
  return worst;
}

void ExpectLimitsKept(const HeightField& field, const TinMesh& mesh, const SampleLimits& limits, double error) {
  for (int y = 0; y < kLimitedSide; ++y) {
    for (int x = 0; x < kLimitedSide; ++x) {
      const auto k = static_cast<std::size_t>(y * kLimitedSide + x);
      ASSERT_LE(ErrorAt(field, mesh, x, y), limits.Allowed(k, error) + 1e-9) << x << " " << y;
      if (limits.forced[k] == 0) continue;
      const auto is_it = [&](SamplePosition p) { return p.x == x && p.y == y; };
      ASSERT_TRUE(std::ranges::any_of(mesh.vertices, is_it)) << x << " " << y;
    }
  }
}

TEST(SampleLimits, HoldAtEverySampleForEveryErrorOfOneRun) {
  const HeightField field = RoughField();
  for (const Criterion criterion : {Criterion::kDelaunay, Criterion::kDataDependent}) {
    GreedyOptions options;
    options.criterion = criterion;
    options.limits = SomeLimits();
    options.record = true;
    GreedyTriangulation greedy(field, options);
    ASSERT_TRUE(greedy.Run({.max_error = 0.5}));
    const Refinement refinement = greedy.MakeRefinement().value();
    for (const double error : {20.0, 5.0, 1.0, 0.5}) {
      const TinMesh mesh = refinement.MeshAt(error);
      ExpectLimitsKept(field, mesh, options.limits, error);
      DropOptions drop;
      drop.max_error = error;
      drop.limits = &options.limits;
      const auto dropped = DropVertices(field, mesh, drop);
      ASSERT_TRUE(dropped.has_value());
      EXPECT_LT(dropped->vertices.size(), mesh.vertices.size());
      ExpectLimitsKept(field, *dropped, options.limits, error);
    }
  }
}

// Limits that ask for nothing change nothing but ties, which scans in vectors round in other ways.
TEST(SampleLimits, OfOneLeaveTheNumberOfVertices) {
  const HeightField field = RoughField();
  GreedyOptions plain, limited;
  limited.limits.weights.assign(kLimitedSide * kLimitedSide, 1);
  limited.limits.caps.assign(limited.limits.weights.size(), 1e6F);
  GreedyTriangulation a(field, plain), b(field, limited);
  ASSERT_TRUE(a.Run({.max_error = 2}) && b.Run({.max_error = 2}));
  EXPECT_NEAR(static_cast<double>(b.vertex_count()), static_cast<double>(a.vertex_count()),
              0.01 * static_cast<double>(a.vertex_count()));
}

// The vertices of a border depend on the border alone.
TEST(SampleLimits, LeaveCommonBordersEqual) {
  const HeightField field = RoughField();
  const HeightField other = MakeField(kLimitedSide, kLimitedSide, [&](int x, int y) {
    return y == 0 ? field.At(x, 0) : static_cast<float>(90 * std::sin(x * 0.77 + y));
  });
  GreedyOptions options, of_other;
  options.limits = SomeLimits();
  of_other.limits = SomeLimits();
  for (std::size_t k = kLimitedSide; k < of_other.limits.weights.size(); ++k) {
    of_other.limits.weights[k] = 3;
    of_other.limits.forced[k] = 0;
  }
  GreedyTriangulation a(field, options), b(other, of_other);
  ASSERT_TRUE(a.Run({.max_error = 3}) && b.Run({.max_error = 3}));
  const auto border = [](const TinMesh& mesh) {
    std::vector<int> columns;
    for (const SamplePosition p : mesh.vertices) {
      if (p.y == 0) columns.push_back(p.x);
    }
    std::ranges::sort(columns);
    return columns;
  };
  EXPECT_EQ(border(a.Mesh()), border(b.Mesh()));
  EXPECT_GT(border(a.Mesh()).size(), 10u);
}

}  // namespace
}  // namespace terrace::tin
