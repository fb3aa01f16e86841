#include "proto/error/tile_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "engine/geo/ellipsoid.h"
#include "proto/error/edge_rows.h"
#include "proto/error/node_verticals.h"
#include "proto/error/row_error.h"
#include "proto/error/triangle_bound.h"
#include "proto/mesh/tile_geometry.h"

namespace terrace::proto {
namespace {

// A linear function over the tile: value at a corner of the triangle and its two gradients.
struct Linear {
  double origin = 0, dx = 0, dy = 0;
  double At(double x, double y) const { return origin + dx * x + dy * y; }
};

// The mesh that is measured.
struct Surface {
  std::int64_t unit = 1;          // from one lattice node to the next
  std::vector<NodePoint> points;  // by vertex
  std::vector<double> heights;    // by vertex, metres above the ellipsoid
  std::vector<geo::Vec3> ecef;    // by vertex
  std::vector<std::array<std::uint32_t, 3>> triangles;
  bool measures_linear =
      true;             // the height interpolated in longitude and latitude is measured, not the flat triangles alone
  double beside_m = 0;  // by which the vertices lie beside the plumb lines of their points, at most
};

// The largest difference between `count` samples of a row and a plane. The first sample lies at (x, y), each further
// one `unit` to the east.
double LargestOfRow(const Linear& plane, double x, double y, double unit, const float* samples, std::int64_t count) {
  constexpr std::int64_t kFew = 8;  // most rows of rough ground: a call would cost more
  const double up = plane.dy * y;
  if (count >= kFew) {
    return LargestOfLinearRow({plane.origin, plane.dx, x, unit, up}, samples, static_cast<std::size_t>(count));
  }
  double largest = 0;
  for (std::int64_t i = 0; i < count; ++i) {
    const double height = plane.origin + plane.dx * (x + unit * static_cast<double>(i)) + up;
    largest = std::max(largest, std::abs(height - samples[i]));
  }
  return largest;
}

template <typename Value>
bool StartsWith(const std::vector<Value>& values, const std::vector<Value>& first) {
  return values.size() >= first.size() && std::equal(first.begin(), first.end(), values.begin());
}

// Whether `b` has all vertices of `a` at the same grid positions and heights, and possibly more.
bool HasVerticesOf(const Surface& a, const Surface& b) {
  return a.unit == b.unit && StartsWith(b.points, a.points) && StartsWith(b.heights, a.heights) &&
         (b.ecef.empty() || StartsWith(b.ecef, a.ecef));
}

// Whether a triangle is unchanged. `of_same_vertices`: comparing the indices of its corners is enough.
bool IsSame(const Surface& a, const Surface& b, std::size_t t, bool of_same_vertices) {
  if (t >= a.triangles.size() || t >= b.triangles.size() || a.triangles[t] != b.triangles[t]) return false;
  return of_same_vertices || std::ranges::all_of(a.triangles[t], [&](std::uint32_t k) {
           return a.points[k] == b.points[k] && a.heights[k] == b.heights[k] && a.ecef[k] == b.ecef[k];
         });
}

}  // namespace

class TileErrorMeter::Impl {
 public:
  Impl(const TileSamples& samples, double bound_m, std::vector<float> allowed_m)
      : samples_(samples),
        cells_(samples.cells()),
        bound_(bound_m),
        allowed_(std::move(allowed_m)),
        min_allowed_(allowed_.empty() ? bound_m
                                      : std::min(bound_m, static_cast<double>(*std::ranges::min_element(allowed_)))),
        verticals_(samples) {}

  int cells() const { return cells_; }
  const Surface& surface() const { return surface_; }
  const NodeVerticals& verticals() const { return verticals_; }

  // Measures the height interpolated in longitude and latitude of every triangle, and bounds the error of the flat
  // triangle. Then measures the flat triangles that may be the worst or exceed the bound.
  TileError Measure(Surface surface) {
    const Surface before = std::exchange(surface_, std::move(surface));
    const bool is_alike = before.unit == surface_.unit && before.measures_linear == surface_.measures_linear &&
                          before.beside_m == surface_.beside_m;
    const bool of_same_vertices = is_alike && HasVerticesOf(before, surface_);
    is_vertex_.assign(static_cast<std::size_t>(cells_ + 1) * static_cast<std::size_t>(cells_ + 1), false);
    for (const NodePoint& p : surface_.points) is_vertex_[NodeIndex(NodeOf(p.x), NodeOf(p.y))] = true;
    errors_.resize(surface_.triangles.size());
    std::size_t worst = 0;
    for (std::size_t t = 0; t < errors_.size(); ++t) {
      TriangleError& error = errors_[t];
      // Triangles that exceed the bound are reported again, because the samples that can be inserted change.
      if (!is_alike || error.max_m > min_allowed_ || !IsSame(before, surface_, t, of_same_vertices))
        error = BoundTriangle(t);
      if (error.max_m > errors_[worst].max_m) worst = t;
    }
    TileError result;
    std::vector<MissedVertex> vertices;
    const auto measure = [&](std::size_t t) {
      if (!errors_[t].is_exact) errors_[t] = MeasureTriangle(t, result.to_insert, vertices);
      result.max_m = std::max(result.max_m, errors_[t].max_m);
    };
    if (!errors_.empty() && errors_[worst].max_m <= min_allowed_) measure(worst);
    for (std::size_t t = 0; t < errors_.size(); ++t) {
      if (errors_[t].max_m > std::min(result.max_m, min_allowed_)) measure(t);
    }
    if (result.to_insert.empty()) result.to_insert = NeighboursOf(vertices);
    result.is_cut_through = result.to_insert.empty() && std::ranges::any_of(vertices, [&](const MissedVertex& vertex) {
                              return PassesBetween(vertex);
                            });
    return result;
  }

 private:
  // The error of a triangle: an upper bound or exact.
  struct TriangleError {
    double max_m = std::numeric_limits<double>::infinity();
    bool is_exact = false;
    // A bound on the error of the height that is linear in longitude and latitude.
    double linear_m = std::numeric_limits<double>::infinity();
  };

  std::size_t NodeIndex(std::int64_t i, std::int64_t j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(cells_ + 1) + static_cast<std::size_t>(i);
  }
  // The lattice node whose rounded position this is.
  std::int64_t NodeOf(std::int64_t coordinate) const { return (coordinate + surface_.unit / 2) / surface_.unit; }

  template <typename Value>
  Linear Through(const std::array<NodePoint, 3>& p, double twice_area, const Value& value) const {
    const double x1 = static_cast<double>(p[1].x - p[0].x), y1 = static_cast<double>(p[1].y - p[0].y);
    const double x2 = static_cast<double>(p[2].x - p[0].x), y2 = static_cast<double>(p[2].y - p[0].y);
    const double d1 = value(1) - value(0), d2 = value(2) - value(0);
    return {value(0), (d1 * y2 - d2 * y1) / twice_area, (d2 * x1 - d1 * x2) / twice_area};
  }

  std::array<NodePoint, 3> CornersOf(std::size_t t) const {
    std::array<NodePoint, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = surface_.points[surface_.triangles[t][k]];
    return p;
  }

  // The worst sample so far. `at` is inside the tile, and set only if `error` is above the bound.
  struct Miss {
    double error = 0;
    tin::SamplePosition at;
  };
  // The worst errors of a triangle: of all samples, of samples that are not vertices, and of vertices.
  struct Found {
    explicit Found(double bound) : sample{bound, {}}, vertex{bound, {}} {}
    double largest = 0;
    Miss sample, vertex;
  };

  void Take(double error, int i, int j, Found& found) const {
    found.largest = std::max(found.largest, error);
    const double counted = Counted(error, i, j);
    if (!(counted > bound_) || !IsInside(i, j)) return;
    if (Miss& miss = MissOf(i, j, found); counted > miss.error) {
      miss = {counted, {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j)}};
    }
  }

  // An error as a share of what is allowed, times the bound.
  double Counted(double error, int i, int j) const {
    return allowed_.empty() ? error : error * (bound_ / static_cast<double>(allowed_[NodeIndex(i, j)]));
  }

  Miss& MissOf(int i, int j, Found& found) const { return is_vertex_[NodeIndex(i, j)] ? found.vertex : found.sample; }

  bool IsVertex(tin::SamplePosition p) const { return is_vertex_[NodeIndex(p.x, p.y)]; }

  struct MissedVertex {
    tin::SamplePosition at;    // the vertex that exceeds the bound
    std::size_t triangle = 0;  // in which it does
  };

  // The neighbours in the row and the column of a node inside the tile.
  static std::array<tin::SamplePosition, 4> NeighboursOf(tin::SamplePosition p) {
    const auto at = [&](int dx, int dy) {
      return tin::SamplePosition{static_cast<std::uint16_t>(p.x + dx), static_cast<std::uint16_t>(p.y + dy)};
    };
    return {at(-1, 0), at(1, 0), at(0, -1), at(0, 1)};
  }

  // The neighbours inside the tile that are not vertices.
  std::vector<tin::SamplePosition> NeighboursOf(const std::vector<MissedVertex>& vertices) const {
    std::vector<tin::SamplePosition> samples;
    for (const MissedVertex& vertex : vertices) {
      for (const tin::SamplePosition p : NeighboursOf(vertex.at)) {
        if (IsInside(p.x, p.y) && !IsVertex(p)) samples.push_back(p);
      }
    }
    return samples;
  }

  // Whether the triangle is larger than half of a cell, though all four neighbours of the vertex are vertices.
  bool PassesBetween(const MissedVertex& vertex) const {
    const std::array<NodePoint, 3> p = CornersOf(vertex.triangle);
    const auto [west, east] = std::minmax({NodeOf(p[0].x), NodeOf(p[1].x), NodeOf(p[2].x)});
    const auto [south, north] = std::minmax({NodeOf(p[0].y), NodeOf(p[1].y), NodeOf(p[2].y)});
    return (east - west > 1 || north - south > 1) &&
           std::ranges::all_of(NeighboursOf(vertex.at), [&](tin::SamplePosition at) { return IsVertex(at); });
  }

  // Calls visit(j, first, last, largest) for each row of nodes in [low, high]. clip(row, first, last) narrows its
  // columns. `largest`: the largest error in these columns of the height that is linear in longitude and latitude.
  template <typename Clip, typename Visit>
  void VisitRows(const Linear& plane, const NodePoint& corner, std::int64_t low, std::int64_t high, const Clip& clip,
                 const Visit& visit) const {
    const std::int64_t unit = surface_.unit, last_row = std::min<std::int64_t>(high / unit, cells_);
    for (std::int64_t j = low > 0 ? (low + unit - 1) / unit : 0; j <= last_row; ++j) {
      std::int64_t first = 0, last = cells_;
      clip(j * unit, first, last);
      if (first > last) continue;
      visit(static_cast<int>(j), static_cast<int>(first), static_cast<int>(last),
            LargestOfRow(plane, static_cast<double>(first * unit - corner.x), static_cast<double>(j * unit - corner.y),
                         static_cast<double>(unit), samples_.Row(static_cast<int>(j)) + first, last - first + 1));
    }
  }

  // The flat triangle differs from the linear one by at most its sagitta, at a position that differs by at most the
  // shift.
  TriangleError BoundTriangle(std::size_t t) const {
    constexpr TriangleError kUnknown;
    const std::array<NodePoint, 3> p = CornersOf(t);
    const std::int64_t twice_area = TwiceArea(p);
    if (twice_area <= 0) return kUnknown;
    const NodeVerticals::Bounds bounds = verticals_.BoundsOf(p, surface_.unit, surface_.beside_m);
    if (!std::isfinite(bounds.shift.x)) return kUnknown;
    const Linear plane = PlaneOf(t, p, twice_area);
    const double unit = static_cast<double>(surface_.unit);
    const double x = bounds.shift.x * unit, y = bounds.shift.y * unit;
    const double beyond = bounds.sagitta_m + std::abs(plane.dx) * x + std::abs(plane.dy) * y;
    if (beyond > min_allowed_) return kUnknown;  // measured in any case: beside cliffs half of all triangles
    double near = FromLevel(t);
    constexpr double kLevel_m = 1e-3;  // on the sea
    if (near > kLevel_m) near = LargestNear(p, plane, bounds.shift);
    return {near + beyond, false, near};
  }

  // An upper bound on the difference between the plane and all samples of the tile, anywhere in the triangle.
  double FromLevel(std::size_t t) const {
    constexpr double kRounding = 1e-9;
    double most = 0;
    for (const std::uint32_t k : surface_.triangles[t]) {
      const double height = surface_.heights[k];
      most = std::max({most, height - verticals_.lowest(), verticals_.highest() - height});
    }
    return most + kRounding * (most + 1);
  }

  // An upper bound on the difference between the plane and the samples of all nodes that lie beside the triangle by at
  // most `shift`. Floats have 24 bits: sides move out by kRounding lattice steps more, for box sides up to 257.
  double LargestNear(const std::array<NodePoint, 3>& p, const Linear& plane, NodeVerticals::Shift shift) const {
    constexpr double kRounding = 0x1p-12;
    const double unit = static_cast<double>(surface_.unit), inverse = 1 / unit, last = cells_;
    std::array<double, 3> x, y;  // lattice steps
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = static_cast<double>(p[k].x) * inverse;
      y[k] = static_cast<double>(p[k].y) * inverse;
    }
    const int west = Ceil(std::max(std::min({x[0], x[1], x[2]}) - shift.x, 0.0)),
              east = static_cast<int>(std::min(std::max({x[0], x[1], x[2]}) + shift.x, last)),
              south = Ceil(std::max(std::min({y[0], y[1], y[2]}) - shift.y, 0.0)),
              north = static_cast<int>(std::min(std::max({y[0], y[1], y[2]}) + shift.y, last));
    if (west > east || south > north) return 0;
    BoxedTriangle box;
    box.columns = east - west + 1;
    box.rows = north - south + 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = k == 2 ? 0 : k + 1;
      const double dx = x[next] - x[k], dy = y[next] - y[k];
      const double move = std::abs(dx) * (shift.y + kRounding) + std::abs(dy) * (shift.x + kRounding);
      box.sides[k] = {static_cast<float>(dy * (x[k] - west) - dx * (y[k] - south) + move), static_cast<float>(-dy),
                      static_cast<float>(dx)};
    }
    const double height = plane.At(static_cast<double>(west) * unit - static_cast<double>(p[0].x),
                                   static_cast<double>(south) * unit - static_cast<double>(p[0].y));
    box.height = static_cast<float>(height);
    box.per_column = static_cast<float>(plane.dx * unit);
    box.per_row = static_cast<float>(plane.dy * unit);
    const double largest = LargestInTriangle(box, samples_.Row(south) + west, cells_ + 3);
    const double rise = std::abs(plane.dx * unit) * box.columns + std::abs(plane.dy * unit) * box.rows;
    return largest + 0x1p-20 * (largest + rise) + std::abs(height - static_cast<double>(box.height));
  }

  // Of a value that is not negative. std::ceil is a call.
  static int Ceil(double value) {
    const int floor = static_cast<int>(value);
    return floor + (static_cast<double>(floor) < value ? 1 : 0);
  }

  TriangleError MeasureTriangle(std::size_t t, std::vector<tin::SamplePosition>& samples,
                                std::vector<MissedVertex>& vertices) const {
    const std::array<NodePoint, 3> p = CornersOf(t);
    Found found(bound_);
    const std::int64_t twice_area = TwiceArea(p);
    const auto measure_linear = [&] {
      if (!surface_.measures_linear || twice_area <= 0) return;
      const std::array<EdgeRows, 3> edges = EdgesOf(p);
      const auto [low, high] = std::minmax({p[0].y, p[1].y, p[2].y});
      const Linear plane = PlaneOf(t, p, twice_area);
      VisitRows(
          plane, p[0], low, high,
          [&](std::int64_t row, std::int64_t& first, std::int64_t& last) {
            for (const EdgeRows& edge : edges) edge.Clip(row, first, last);
          },
          [&](int j, int first, int last, double largest) {
            found.largest = std::max(found.largest, largest);
            if (largest <= min_allowed_) return;  // no sample of the row has too large an error
            const double y = static_cast<double>(j * surface_.unit - p[0].y);
            for (int i = first; i <= last; ++i) {
              const double height = plane.At(static_cast<double>(i * surface_.unit - p[0].x), y);
              Take(std::abs(height - samples_.At(i, j)), i, j, found);
            }
          });
    };
    // Linear heights that have no sample with too large an error are needed only if they may have the largest one.
    const double linear_m = errors_[t].linear_m;
    const bool is_linear_first = linear_m > min_allowed_;
    if (is_linear_first) measure_linear();
    MeasureFlat(surface_.triangles[t], p, found);
    if (!is_linear_first && linear_m > found.largest) measure_linear();
    if (found.sample.error > bound_) samples.push_back(found.sample.at);
    if (found.vertex.error > bound_) vertices.push_back({found.vertex.at, t});
    return {found.largest, true};
  }

  std::array<EdgeRows, 3> EdgesOf(const std::array<NodePoint, 3>& p) const {
    return {EdgeRows(p[0], p[1], surface_.unit), EdgeRows(p[1], p[2], surface_.unit),
            EdgeRows(p[2], p[0], surface_.unit)};
  }

  Linear PlaneOf(std::size_t t, const std::array<NodePoint, 3>& p, std::int64_t twice_area) const {
    return Through(p, static_cast<double>(twice_area),
                   [&](std::size_t k) { return surface_.heights[surface_.triangles[t][k]]; });
  }

  // The intersections of the nodes' plumb lines with the flat triangle. The position of a point of the triangle is not
  // exactly the mean of its corners' positions, so nodes near the rim are tested (NodeVerticals::Meets) if they matter.
  void MeasureFlat(const std::array<std::uint32_t, 3>& triangle, const std::array<NodePoint, 3>& p,
                   Found& found) const {
    constexpr double kNothing_m = 0.0005;  // smaller errors need no test
    const std::array<geo::Vec3, 3> corners = {surface_.ecef[triangle[0]], surface_.ecef[triangle[1]],
                                              surface_.ecef[triangle[2]]};
    const NodeVerticals::Plane plane(corners);
    if (plane.is_line) return;
    const VerticalsInTriangle footprint(p, surface_.unit, surface_.beside_m, verticals_);
    for (int j = footprint.first_row(); j <= footprint.last_row(); ++j) {
      const VerticalsInTriangle::Columns columns = footprint.ColumnsOf(j);
      if (columns.first > columns.last) continue;
      const auto measure = [&](std::int64_t from, std::int64_t to) {
        for (int i = static_cast<int>(from); i <= to; ++i) {
          const double error = std::abs(verticals_.HeightOn(plane, i, j) - samples_.At(i, j));
          const double counted = Counted(error, i, j);
          const bool counts = error > found.largest || (counted > bound_ && counted > MissOf(i, j, found).error);
          if (!counts) continue;  // NaN: no height
          const bool meets = (i >= columns.inner_first && i <= columns.inner_last) || error <= kNothing_m ||
                             verticals_.Meets(corners, i, j);
          if (meets) Take(error, i, j, found);
        }
      };
      // Inner nodes need no test. If none of them has too large an error, only their largest one counts.
      const bool has_inner = columns.inner_first <= columns.inner_last;
      const double inner =
          has_inner ? verticals_.LargestOfRow(plane, j, columns.inner_first, columns.inner_last, samples_.Row(j)) : 0;
      if (has_inner && inner <= min_allowed_) {
        found.largest = std::max(found.largest, inner);
        measure(columns.first, columns.inner_first - 1);
        measure(columns.inner_last + 1, columns.last);
      } else {
        measure(columns.first, columns.last);
      }
    }
  }

  bool IsInside(int i, int j) const { return i > 0 && j > 0 && i < cells_ && j < cells_; }

  const TileSamples samples_;
  const int cells_;
  const double bound_;
  const std::vector<float> allowed_;  // by node; empty: the bound
  const double min_allowed_;          // the smallest error that a node may have

  // State of the mesh that is measured.
  Surface surface_;
  std::vector<bool> is_vertex_;        // by node
  std::vector<TriangleError> errors_;  // by triangle

  const NodeVerticals verticals_;
};

TileErrorMeter::TileErrorMeter(const TileSamples& samples, double bound_m, std::vector<float> allowed_m)
    : impl_(std::make_unique<Impl>(samples, bound_m, std::move(allowed_m))) {}
TileErrorMeter::~TileErrorMeter() = default;

TileError TileErrorMeter::Measure(const QuantizedTile& tile) {
  Surface surface{kQuantizedMax, {}, {}, {}, tile.triangles};
  surface.points.reserve(tile.u.size());
  surface.heights.reserve(tile.u.size());
  const std::int64_t cells = impl_->cells();
  for (std::size_t k = 0; k < tile.u.size(); ++k) {
    surface.points.push_back({tile.u[k] * cells, tile.v[k] * cells});
    surface.heights.push_back(HeightAt(tile, tile.h[k]));
  }
  // Equal places and heights have equal positions.
  const Surface& before = impl_->surface();
  if (before.measures_linear && HasVerticesOf(before, surface)) surface.ecef = before.ecef;
  DecodeFurtherPositions(tile, surface.ecef);
  return impl_->Measure(std::move(surface));
}

TileError TileErrorMeter::MeasureFlat(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions) {
  Surface surface{1, {}, {}, positions, mesh.triangles, false};
  surface.points.reserve(mesh.vertices.size());
  surface.heights.reserve(mesh.vertices.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    const tin::SamplePosition node = mesh.vertices[k];
    const NodeVerticals::Position position = impl_->verticals().PositionOf(positions[k], node.x, node.y);
    surface.points.push_back({node.x, node.y});
    surface.heights.push_back(position.height_m);
    surface.beside_m = std::max(surface.beside_m, position.beside_m);
  }
  return impl_->Measure(std::move(surface));
}

const std::vector<geo::Vec3>& TileErrorMeter::positions() const { return impl_->surface().ecef; }

bool AllCounterClockwise(const QuantizedTile& tile) {
  return std::all_of(tile.triangles.begin(), tile.triangles.end(), [&](const std::array<std::uint32_t, 3>& t) {
    const int x1 = tile.u[t[1]] - tile.u[t[0]], y1 = tile.v[t[1]] - tile.v[t[0]];
    const int x2 = tile.u[t[2]] - tile.u[t[0]], y2 = tile.v[t[2]] - tile.v[t[0]];
    return std::int64_t{x1} * y2 > std::int64_t{y1} * x2;
  });
}

}  // namespace terrace::proto
