#include "proto/tile_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "engine/geo/ellipsoid.h"
#include "proto/lattice_angles.h"
#include "proto/tile_geometry.h"

namespace terrace::proto {
namespace {

// Coordinates in which both the vertices and the lattice nodes are integers. Quantized ones: 1 / (32767 * cells) of the
// tile; u * cells and i * 32767 stay below 2^23, products of two below 2^46. Of a mesh on the lattice: its cells.
struct Point {
  std::int64_t x = 0, y = 0;

  friend bool operator==(const Point&, const Point&) = default;
};

constexpr std::int64_t CeilDiv(std::int64_t a, std::int64_t b) { return a >= 0 ? (a + b - 1) / b : -(-a / b); }

// Where an edge a -> b crosses the rows of nodes: the nodes of row y on its left or on it are those with
//   (b - a) x (p - a) >= 0, that is dx (y - a.y) - dy (x - a.x) >= 0.
class EdgeRows {
 public:
  // `unit`: from one lattice node to the next.
  EdgeRows(Point a, Point b, std::int64_t unit)
      : dx_(b.x - a.x), dy_(b.y - a.y), at_zero_(dy_ * a.x - dx_ * a.y), inverse_(InverseOf(std::abs(dy_) * unit)) {}

  // Narrows the columns [first, last] of a row between the triangle's lowest and highest.
  void Clip(std::int64_t y, std::int64_t& first, std::int64_t& last) const {
    if (dy_ > 0) last = std::min(last, Floor(y));
    if (dy_ < 0) first = std::max(first, -Floor(y));
  }

 private:
  static double InverseOf(std::int64_t d) { return d == 0 ? 0 : 1 / static_cast<double>(d); }

  // Of n = dx y + dy a.x - dx a.y over d = |dy| unit, exact with one multiplication: n is a double without rounding,
  // the quotient is below 2^9 in magnitude, so n * (1 / d) is off by less than 2^-42; one that is no integer lies at
  // least 1 / d > 2^-39 below the next. Adding 2^-41 lifts an integer that was rounded down above itself, and lifts
  // nothing else over an integer.
  std::int64_t Floor(std::int64_t y) const {
    const double quotient = static_cast<double>(dx_ * y + at_zero_) * inverse_ + 0x1p-41;
    const auto towards_zero = static_cast<std::int64_t>(quotient);
    return towards_zero - (static_cast<double>(towards_zero) > quotient ? 1 : 0);
  }

  std::int64_t dx_, dy_, at_zero_;
  double inverse_;
};

// A linear function over the tile: value at a corner of the triangle and its two gradients.
struct Linear {
  double origin = 0, dx = 0, dy = 0;
  double At(double x, double y) const { return origin + dx * x + dy * y; }
};

// What the meter needs to know of a mesh. A reading without data is not measured.
struct Surface {
  std::int64_t unit = 1;        // from one lattice node to the next
  std::vector<Point> points;    // by vertex
  std::vector<double> heights;  // by vertex, metres: the reading in longitude and latitude
  std::vector<geo::Vec3> ecef;  // by vertex: the flat triangles
  std::vector<std::array<std::uint32_t, 3>> triangles;

  bool is_planar() const { return !heights.empty(); }
  bool is_curved() const { return !ecef.empty(); }
};

template <typename Value>
bool StartsWith(const std::vector<Value>& values, const std::vector<Value>& first) {
  return values.size() >= first.size() && std::equal(first.begin(), first.end(), values.begin());
}

// Whether `b` has the vertices of `a`, all in the same place on the grid and in height, and perhaps more.
bool HasVerticesOf(const Surface& a, const Surface& b) {
  return a.unit == b.unit && StartsWith(b.points, a.points) && StartsWith(b.heights, a.heights);
}

// Whether a triangle lies in the same place in both. `of_same_vertices`: it does if it has the same corners.
bool IsSame(const Surface& a, const Surface& b, std::size_t t, bool of_same_vertices) {
  if (t >= a.triangles.size() || t >= b.triangles.size() || a.triangles[t] != b.triangles[t]) return false;
  return of_same_vertices || std::ranges::all_of(a.triangles[t], [&](std::uint32_t k) {
           return a.points[k] == b.points[k] && (!a.is_planar() || a.heights[k] == b.heights[k]) &&
                  (!a.is_curved() || a.ecef[k] == b.ecef[k]);
         });
}

}  // namespace

class TileMeter::Impl {
 public:
  Impl(const LatticeView& lattice, double bound_m) : lattice_(lattice), cells_(lattice.cells()), bound_(bound_m) {}

  int cells() const { return cells_; }
  const Surface& surface() const { return surface_; }

  TileError Measure(Surface surface) {
    const Surface before = std::exchange(surface_, std::move(surface));
    const bool is_alike = before.unit == surface_.unit && before.is_planar() == surface_.is_planar() &&
                          before.is_curved() == surface_.is_curved();
    const bool of_same_vertices = is_alike && HasVerticesOf(before, surface_) && StartsWith(surface_.ecef, before.ecef);
    planar_ = surface_.is_planar();
    curved_ = surface_.is_curved();
    is_vertex_.assign(static_cast<std::size_t>(cells_ + 1) * static_cast<std::size_t>(cells_ + 1), false);
    for (const Point& p : surface_.points) is_vertex_[NodeIndex(NodeOf(p.x), NodeOf(p.y))] = true;
    if (curved_ && row_up_.empty()) PrepareCurved();
    TileError result;
    errors_.resize(surface_.triangles.size(), kUnknown);
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      const std::size_t misses = result.misses.size();
      double& error = errors_[t];
      if (!is_alike || error == kUnknown || !IsSame(before, surface_, t, of_same_vertices))
        error = MeasureTriangle(t, result.misses);
      result.max_m = std::max(result.max_m, error);
      if (result.misses.size() > misses) error = kUnknown;  // the miss is to be told again
    }
    return result;
  }

 private:
  static constexpr double kUnknown = -1;

  std::size_t NodeIndex(std::int64_t i, std::int64_t j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(cells_ + 1) + static_cast<std::size_t>(i);
  }
  // The lattice node whose rounded position this is.
  std::int64_t NodeOf(std::int64_t coordinate) const { return (coordinate + surface_.unit / 2) / surface_.unit; }

  void PrepareCurved() {
    const LatticeAngles angles(lattice_);
    for (const geo::SinCos& column : angles.columns) column_up_.push_back(geo::SurfaceNormal(column, {}));
    for (const geo::SinCos& row : angles.rows) {
      const geo::Vec3 up = geo::SurfaceNormal({}, row);
      row_up_.push_back(up);
      row_base_.push_back(geo::Dot(geo::ToEcef({}, row, 0), up));
    }
  }

  template <typename Value>
  Linear Through(const std::array<Point, 3>& p, double area, const Value& value) const {
    const double x1 = static_cast<double>(p[1].x - p[0].x), y1 = static_cast<double>(p[1].y - p[0].y);
    const double x2 = static_cast<double>(p[2].x - p[0].x), y2 = static_cast<double>(p[2].y - p[0].y);
    const double d1 = value(1) - value(0), d2 = value(2) - value(0);
    return {value(0), (d1 * y2 - d2 * y1) / area, (d2 * x1 - d1 * x2) / area};
  }

  // Rows and, in a row, columns of nodes inside the triangle or on its rim, in integers.
  double MeasureTriangle(std::size_t t, std::vector<tin::SamplePosition>& misses) const {
    const std::array<std::uint32_t, 3>& triangle = surface_.triangles[t];
    const std::int64_t unit = surface_.unit;
    std::array<Point, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = surface_.points[triangle[k]];
    const std::int64_t area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
    if (area <= 0) return 0;
    const double twice_area = static_cast<double>(area);
    Linear plane;
    if (planar_) plane = Through(p, twice_area, [&](std::size_t k) { return surface_.heights[triangle[k]]; });
    std::array<Linear, 3> chord{};
    if (curved_) {
      chord[0] = Through(p, twice_area, [&](std::size_t k) { return surface_.ecef[triangle[k]].x; });
      chord[1] = Through(p, twice_area, [&](std::size_t k) { return surface_.ecef[triangle[k]].y; });
      chord[2] = Through(p, twice_area, [&](std::size_t k) { return surface_.ecef[triangle[k]].z; });
    }
    const auto [low, high] = std::minmax({p[0].y, p[1].y, p[2].y});
    const std::array<EdgeRows, 3> edges = {EdgeRows(p[0], p[1], unit), EdgeRows(p[1], p[2], unit),
                                           EdgeRows(p[2], p[0], unit)};
    double largest = 0, worst_miss = bound_;
    tin::SamplePosition miss;
    bool missed = false;
    for (std::int64_t j = CeilDiv(low, unit); j * unit <= high; ++j) {
      const std::int64_t y = j * unit;
      std::int64_t first = 0, last = cells_;
      for (const EdgeRows& edge : edges) edge.Clip(y, first, last);
      for (std::int64_t i = first; i <= last; ++i) {
        const double dx = static_cast<double>(i * unit - p[0].x), dy = static_cast<double>(y - p[0].y);
        const double error = ErrorAt(plane, chord, static_cast<int>(i), static_cast<int>(j), dx, dy);
        largest = std::max(largest, error);
        if (error > worst_miss && CanMend(i, j)) {
          worst_miss = error;
          miss = {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j)};
          missed = true;
        }
      }
    }
    if (missed) misses.push_back(miss);
    return largest;
  }

  double ErrorAt(const Linear& plane, const std::array<Linear, 3>& chord, int i, int j, double dx, double dy) const {
    const double sample = lattice_.At(i, j);
    const double error = planar_ ? std::abs(plane.At(dx, dy) - sample) : 0;
    if (!curved_) return error;
    const geo::Vec3& row = row_up_[static_cast<std::size_t>(j)];
    const geo::Vec3& column = column_up_[static_cast<std::size_t>(i)];
    const double above = row.x * (chord[0].At(dx, dy) * column.x + chord[1].At(dx, dy) * column.y) +
                         row.z * chord[2].At(dx, dy) - row_base_[static_cast<std::size_t>(j)];
    return std::max(error, std::abs(above - sample));
  }

  bool CanMend(std::int64_t i, std::int64_t j) const {
    return i > 0 && j > 0 && i < cells_ && j < cells_ && !is_vertex_[NodeIndex(i, j)];
  }

  const LatticeView lattice_;
  const int cells_;
  const double bound_;

  // Of the mesh that is measured.
  Surface surface_;
  bool planar_ = false, curved_ = false;
  std::vector<bool> is_vertex_;  // by node
  std::vector<double> errors_;   // by triangle; kUnknown: it is to be measured in any case

  std::vector<geo::Vec3> column_up_, row_up_;
  std::vector<double> row_base_;  // by row: the ellipsoid's surface along its normal there
};

TileMeter::TileMeter(const LatticeView& lattice, double bound_m) : impl_(std::make_unique<Impl>(lattice, bound_m)) {}
TileMeter::~TileMeter() = default;

TileError TileMeter::Measure(const QuantizedTile& tile, bool curved) {
  Surface surface{kQuantizedMax, {}, {}, {}, tile.triangles};
  surface.points.reserve(tile.u.size());
  surface.heights.reserve(tile.u.size());
  const std::int64_t cells = impl_->cells();
  for (std::size_t k = 0; k < tile.u.size(); ++k) {
    surface.points.push_back({tile.u[k] * cells, tile.v[k] * cells});
    surface.heights.push_back(HeightAt(tile, tile.h[k]));
  }
  if (curved) {
    // Equal places and heights have equal positions.
    const Surface& before = impl_->surface();
    if (HasVerticesOf(before, surface)) surface.ecef = before.ecef;
    DecodeFurtherPositions(tile, surface.ecef);
  }
  return impl_->Measure(std::move(surface));
}

TileError TileMeter::MeasureFlat(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions) {
  Surface surface{1, {}, {}, positions, mesh.triangles};
  surface.points.reserve(mesh.vertices.size());
  for (const tin::SamplePosition p : mesh.vertices) surface.points.push_back({p.x, p.y});
  return impl_->Measure(std::move(surface));
}

TileError MeasureTileError(const LatticeView& lattice, const QuantizedTile& tile, double bound_m, bool curved) {
  return TileMeter(lattice, bound_m).Measure(tile, curved);
}

TileError MeasureFlatError(const LatticeView& lattice, const tin::TinMesh& mesh,
                           const std::vector<geo::Vec3>& positions, double bound_m) {
  return TileMeter(lattice, bound_m).MeasureFlat(mesh, positions);
}

bool AllCounterClockwise(const QuantizedTile& tile) {
  return std::all_of(tile.triangles.begin(), tile.triangles.end(), [&](const std::array<std::uint32_t, 3>& t) {
    const int x1 = tile.u[t[1]] - tile.u[t[0]], y1 = tile.v[t[1]] - tile.v[t[0]];
    const int x2 = tile.u[t[2]] - tile.u[t[0]], y2 = tile.v[t[2]] - tile.v[t[0]];
    return std::int64_t{x1} * y2 > std::int64_t{y1} * x2;
  });
}

}  // namespace terrace::proto
