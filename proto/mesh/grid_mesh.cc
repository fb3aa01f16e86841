#include "proto/mesh/grid_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "engine/core/check.h"
#include "proto/lattice_angles.h"
#include "proto/mesh/vertex_order.h"

namespace terrace::proto {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

// 1 / step is exact, and so are products with it.
GridPoint Snap(geo::Vec3 ecef, double per_metre) {
  const auto whole = [&](double metres) { return static_cast<std::int64_t>(std::floor(metres * per_metre + 0.5)); };
  return {whole(ecef.x), whole(ecef.y), whole(ecef.z)};
}

class NodePlacer {
 public:
  explicit NodePlacer(const TileSamples& samples) : samples_(samples), angles_(samples) {
    for (const geo::SinCos& row : angles_.rows) bases_.push_back(geo::ToEcef({}, row, 0));
  }

  geo::Vec3 Place(tin::SamplePosition node, double below_m) const {
    const geo::SinCos &longitude = angles_.columns[node.x], &latitude = angles_.rows[node.y];
    const geo::Vec3& base = bases_[node.y];
    const double height = static_cast<double>(samples_.At(node.x, node.y)) - below_m;
    const double from_axis = base.x + latitude.cos * height;
    return {from_axis * longitude.cos, from_axis * longitude.sin, base.z + latitude.sin * height};
  }

 private:
  const TileSamples& samples_;
  const LatticeAngles angles_;
  std::vector<geo::Vec3> bases_;  // by row: on the ellipsoid at longitude 0
};

// The border vertices counter-clockwise from the south-western corner, each once.
std::vector<std::uint32_t> Rim(const tin::TinMesh& mesh, int cells) {
  std::vector<std::pair<int, std::uint32_t>> along;
  for (std::uint32_t k = 0; k < mesh.vertices.size(); ++k) {
    const int x = mesh.vertices[k].x, y = mesh.vertices[k].y;
    if (y == 0 && x < cells)
      along.emplace_back(x, k);
    else if (x == cells && y < cells)
      along.emplace_back(cells + y, k);
    else if (y == cells && x > 0)
      along.emplace_back(3 * cells - x, k);
    else if (x == 0 && y > 0)
      along.emplace_back(4 * cells - y, k);
  }
  std::sort(along.begin(), along.end());
  std::vector<std::uint32_t> rim;
  rim.reserve(along.size());
  for (const auto& [distance, vertex] : along) rim.push_back(vertex);
  return rim;
}

// Two triangles between each two neighbours on the rim and the points below them:
//
//     a---b      seen from outside; the feet are numbered from first_foot in the order of the rim
//     |  /|
//     | / |
//     A---B
//
// `hangs`: from which of the rim's edges; empty: all.
void HangSkirt(const std::vector<std::uint32_t>& rim, std::uint32_t first_foot, const std::vector<bool>& hangs,
               std::vector<Triangle>& triangles) {
  const auto count = static_cast<std::uint32_t>(rim.size());
  for (std::uint32_t k = 0; k < count; ++k) {
    if (!hangs.empty() && !hangs[k]) continue;
    const std::uint32_t next = (k + 1) % count;
    triangles.push_back({rim[k], first_foot + k, rim[next]});
    triangles.push_back({rim[next], first_foot + k, first_foot + next});
  }
}

// Removes triangles, and returns the rim's edges that are left.
std::vector<bool> CutHoles(const std::vector<std::uint8_t>& left_out, const std::vector<std::uint32_t>& rim,
                           std::vector<Triangle>& triangles) {
  std::vector<Triangle> left;
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (left_out[t] != 0) continue;
    left.push_back(triangles[t]);
    for (std::size_t k = 0; k < 3; ++k) edges.emplace(triangles[t][k], triangles[t][(k + 1) % 3]);
  }
  triangles = std::move(left);
  std::vector<bool> hangs(rim.size());
  for (std::size_t k = 0; k < rim.size(); ++k) hangs[k] = edges.contains({rim[k], rim[(k + 1) % rim.size()]});
  return hangs;
}

bool HasMergedCorners(const Triangle& t, const std::vector<GridPoint>& points) {
  return points[t[0]] == points[t[1]] || points[t[1]] == points[t[2]] || points[t[2]] == points[t[0]];
}

// The first of the rim's edges whose ends are apart, alone. Beside a pole, where nodes of a row coincide, it may be far
// along the rim. The western side always has one, because rows are at least 64 steps apart.
std::vector<bool> FirstEdge(const std::vector<std::uint32_t>& rim, const std::vector<GridPoint>& points) {
  std::vector<bool> edges(rim.size());
  std::size_t k = 0;
  while (k + 1 < rim.size() && points[rim[k]] == points[rim[k + 1]]) ++k;
  edges[k] = true;
  return edges;
}

struct GridBox {
  GridPoint min{}, max{};
};

GridBox BoxOf(const std::vector<GridPoint>& points) {
  GridBox box{points.front(), points.front()};
  for (const GridPoint& p : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.min[axis] = std::min(box.min[axis], p[axis]);
      box.max[axis] = std::max(box.max[axis], p[axis]);
    }
  }
  return box;
}

}  // namespace

double GridStep(const geo::Lattice& lattice, double error_m, PositionWidth width) {
  constexpr double kFinestStepMetres = 0x1p-16;
  const double cell_m = geo::kSemiMajorAxis * geo::ToRadians(lattice.StepDegrees());
  // A tile's side is at most 2^23 steps: a step that does not fit would be doubled, but not by the neighbour
  // (FitsFloats).
  const double side_m = cell_m * lattice.cells;
  const double fitting_m = PowerOfTwoAtMost(side_m / 0x1p22);
  const double step_m = std::max({PowerOfTwoAtMost(std::min(error_m / 32, cell_m / 64)), fitting_m, kFinestStepMetres});
  if (width == PositionWidth::k16Bits) return step_m;
  // Half the diagonal of a cube of 2^-7 m is 7 mm.
  constexpr double kBorderStepMetres = 0x1p-7;
  return std::min(step_m, std::max(kBorderStepMetres, fitting_m));
}

GridSteps::GridSteps(const geo::Lattice& lattice, const EdgeErrors& errors, double smallest_allowed_m,
                     PositionWidth width)
    : inside(GridStep(lattice, errors.tile, width)) {
  // A step that does not fit would be doubled, but not by the neighbour (FitsFloats).
  const double side_m = geo::kSemiMajorAxis * geo::ToRadians(lattice.StepDegrees()) * lattice.cells;
  const double finest_m = std::min(PowerOfTwoAtMost(side_m / 0x1p22), inside);
  const auto step = [&](double error_m) { return std::max(GridStep(lattice, error_m, width), finest_m); };
  for (std::size_t k = 0; k < 4; ++k) {
    side[k] = step(errors.side[k]);
    corner[k] = step(errors.corner[k]);
  }
  inside = step(std::min(errors.tile, smallest_allowed_m));
  // A corner's step may follow from an edge that is not the tile's.
  for (std::size_t k = 0; k < 4; ++k) inside = std::min({inside, side[k], corner[k]});
}

void GridSteps::Double() {
  inside *= 2;
  // Coarser steps stay: they are those of the neighbours.
  for (std::size_t k = 0; k < 4; ++k) side[k] = std::max(side[k], inside), corner[k] = std::max(corner[k], inside);
}

std::vector<GridPoint> SnapVertices(const TileSamples& samples, const tin::TinMesh& mesh, const GridSteps& steps) {
  const NodePlacer placer(samples);
  EdgeSteps of_edges;
  of_edges.side = steps.side;
  of_edges.corner = steps.corner;
  std::vector<GridPoint> points;
  points.reserve(mesh.vertices.size());
  for (const tin::SamplePosition node : mesh.vertices) {
    const double on_edge = StepAt(of_edges, node.x, node.y, samples.cells());
    const double step = on_edge > 0 ? on_edge : steps.inside;
    GridPoint point = Snap(placer.Place(node, 0), 1 / step);
    const auto units = static_cast<std::int64_t>(step / steps.inside);
    for (std::int64_t& axis : point) axis *= units;
    points.push_back(point);
  }
  return points;
}

bool FitsFloats(const std::vector<GridPoint>& points, double step_m, double skirt_depth_m) {
  constexpr double kMaxSteps = 0x1p23;
  const GridBox box = BoxOf(points);
  const double feet = skirt_depth_m / step_m + 2;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (static_cast<double>(box.max[axis] - box.min[axis]) + feet >= kMaxSteps) return false;
  }
  return true;
}

std::vector<geo::Vec3> GridPositions(const std::vector<GridPoint>& points, double step_m) {
  std::vector<geo::Vec3> positions;
  positions.reserve(points.size());
  for (const auto& [x, y, z] : points) {
    positions.push_back(
        {static_cast<double>(x) * step_m, static_cast<double>(y) * step_m, static_cast<double>(z) * step_m});
  }
  return positions;
}

GridMesh MakeGridMesh(const TileSamples& samples, const tin::TinMesh& mesh, const std::vector<GridPoint>& points,
                      const std::vector<geo::Vec3>& normals, double step_m, double skirt_depth_m,
                      const std::vector<std::uint8_t>& left_out) {
  TERRACE_CHECK(points.size() == mesh.vertices.size() && normals.size() == points.size());
  const NodePlacer placer(samples);
  const std::vector<std::uint32_t> rim = Rim(mesh, samples.cells());
  std::vector<GridPoint> all = points;
  std::vector<geo::Vec3> all_normals = normals;
  std::vector<tin::SamplePosition> nodes = mesh.vertices;
  for (const std::uint32_t top : rim) {
    all.push_back(Snap(placer.Place(mesh.vertices[top], skirt_depth_m), 1 / step_m));
    all_normals.push_back(normals[top]);
    nodes.push_back(mesh.vertices[top]);
  }
  std::vector<Triangle> triangles = mesh.triangles;
  const std::vector<bool> hangs = left_out.empty() ? std::vector<bool>() : CutHoles(left_out, rim, triangles);
  const auto first_foot = static_cast<std::uint32_t>(points.size());
  HangSkirt(rim, first_foot, hangs, triangles);
  const auto is_merged = [&](const Triangle& t) { return HasMergedCorners(t, all); };
  std::erase_if(triangles, is_merged);
  if (triangles.empty()) {
    // glTF needs a triangle: two grid steps tall, which rounding leaves apart, so that it is not seen.
    for (std::size_t k = 0; k < rim.size(); ++k) {
      const tin::SamplePosition node = mesh.vertices[rim[k]];
      const GridPoint top = Snap(placer.Place(node, 0), 1 / step_m),
                      below = Snap(placer.Place(node, 2 * step_m), 1 / step_m);
      for (std::size_t axis = 0; axis < 3; ++axis)
        all[first_foot + k][axis] = points[rim[k]][axis] + below[axis] - top[axis];
    }
    HangSkirt(rim, first_foot, FirstEdge(rim, points), triangles);
    std::erase_if(triangles, is_merged);
  }

  VertexOrder order = OrderByFirstUse(triangles, all.size());
  GridMesh grid;
  grid.step_m = step_m;
  const GridBox box = BoxOf(all);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.origin[axis] = box.min[axis] + (box.max[axis] - box.min[axis]) / 2;
  }
  grid.triangles = std::move(order.triangles);
  grid.cells = samples.cells();
  grid.uv.reserve(order.old_index.size());
  grid.positions.reserve(order.old_index.size());
  grid.normals.reserve(order.old_index.size());
  for (const std::uint32_t old : order.old_index) {
    std::array<std::int32_t, 3>& position = grid.positions.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      position[axis] = static_cast<std::int32_t>(all[old][axis] - grid.origin[axis]);
    }
    grid.normals.push_back(all_normals[old]);
    grid.uv.push_back(
        {static_cast<std::uint16_t>(nodes[old].x), static_cast<std::uint16_t>(grid.cells - nodes[old].y)});
  }
  return grid;
}

}  // namespace terrace::proto
