#include "tests/engine/tin/mesh_laws.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh_error.h"

namespace terrace::tin {
namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

// Directed edges, each with the corner opposite it.
std::map<Edge, std::uint32_t> DirectedEdges(const TinMesh& mesh) {
  std::map<Edge, std::uint32_t> edges;
  for (const auto& [a, b, c] : mesh.triangles) {
    edges.insert({{a, b}, c});
    edges.insert({{b, c}, a});
    edges.insert({{c, a}, b});
  }
  return edges;
}

}  // namespace

testing::AssertionResult CoversExactly(const HeightField& field, const TinMesh& mesh) {
  const int east = field.width() - 1, north = field.height() - 1;
  std::set<std::pair<int, int>> seen;
  for (const SamplePosition p : mesh.vertices) {
    if (!seen.insert({p.x, p.y}).second) return testing::AssertionFailure() << "vertex twice: " << p.x << ", " << p.y;
    if (p.x > east || p.y > north) return testing::AssertionFailure() << "outside: " << p.x << ", " << p.y;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const SamplePosition p = mesh.vertices[i];
    if ((p.x != 0 && p.x != east) || (p.y != 0 && p.y != north))
      return testing::AssertionFailure() << "corners not first";
  }
  std::int64_t doubled_area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::int64_t turn = Orientation(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
    if (turn <= 0) return testing::AssertionFailure() << "triangle " << a << ' ' << b << ' ' << c << " turns " << turn;
    doubled_area += turn;
  }
  if (doubled_area != std::int64_t{2} * east * north)
    return testing::AssertionFailure() << "area / 2: " << doubled_area;

  const std::map<Edge, std::uint32_t> edges = DirectedEdges(mesh);
  if (edges.size() != 3 * mesh.triangles.size()) return testing::AssertionFailure() << "an edge is used twice";
  for (const auto& [edge, opposite] : edges) {
    if (edges.contains({edge.second, edge.first})) continue;
    const SamplePosition p = mesh.vertices[edge.first], q = mesh.vertices[edge.second];
    const bool on_border = (p.x == q.x && (p.x == 0 || p.x == east)) || (p.y == q.y && (p.y == 0 || p.y == north));
    if (!on_border) return testing::AssertionFailure() << "open edge inside: " << edge.first << ' ' << edge.second;
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult IsDelaunay(const TinMesh& mesh) {
  const std::map<Edge, std::uint32_t> edges = DirectedEdges(mesh);
  for (const auto& [edge, opposite] : edges) {
    const auto across = edges.find({edge.second, edge.first});
    if (across == edges.end()) continue;
    if (InCircle(mesh.vertices[edge.first], mesh.vertices[edge.second], mesh.vertices[opposite],
                 mesh.vertices[across->second]) > 0) {
      return testing::AssertionFailure() << "edge " << edge.first << ' ' << edge.second << " is not Delaunay";
    }
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult IsWithin(const HeightField& field, const TinMesh& mesh, double bound) {
  std::size_t valid = 0;
  double magnitude = 0;
  for (int y = 0; y < field.height(); ++y) {
    for (int x = 0; x < field.width(); ++x) {
      if (std::isnan(field.At(x, y))) continue;
      ++valid;
      magnitude = std::max(magnitude, std::abs(static_cast<double>(field.At(x, y))));
    }
  }
  const MeshError error = MeasureError(field, mesh);
  if (error.samples != valid)
    return testing::AssertionFailure() << error.samples << " of " << valid << " samples covered";
  // The measurement and the mesher round differently.
  if (error.max > bound + 1e-12 * magnitude) {
    return testing::AssertionFailure() << error.max << " off at " << error.worst.x << ", " << error.worst.y;
  }
  return testing::AssertionSuccess();
}

std::vector<int> BorderVertices(const HeightField& field, const TinMesh& mesh, Side side) {
  std::vector<int> along;
  for (const SamplePosition p : mesh.vertices) {
    switch (side) {
      case Side::kSouth:
        if (p.y == 0) along.push_back(p.x);
        break;
      case Side::kNorth:
        if (p.y == field.height() - 1) along.push_back(p.x);
        break;
      case Side::kWest:
        if (p.x == 0) along.push_back(p.y);
        break;
      case Side::kEast:
        if (p.x == field.width() - 1) along.push_back(p.y);
        break;
    }
  }
  std::sort(along.begin(), along.end());
  return along;
}

testing::AssertionResult AreEqual(const TinMesh& a, const TinMesh& b) {
  if (a.vertices.size() != b.vertices.size()) {
    return testing::AssertionFailure() << a.vertices.size() << " and " << b.vertices.size() << " vertices";
  }
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    if (!(a.vertices[i] == b.vertices[i])) return testing::AssertionFailure() << "vertex " << i << " differs";
  }
  if (a.triangles != b.triangles) return testing::AssertionFailure() << "triangles differ";
  return testing::AssertionSuccess();
}

TinMesh MeshAt(const HeightField& field, const GreedyGoal& goal, const GreedyOptions& options) {
  GreedyTriangulation tin(field, options);
  EXPECT_TRUE(tin.Run(goal));
  return tin.Mesh();
}

}  // namespace terrace::tin
