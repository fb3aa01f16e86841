#include "proto/surface_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "proto/tile_geometry.h"

namespace terrace::proto {
namespace {

// The smallest radius of curvature there is: a meridian's at the equator.
constexpr double kSmallestRadius = geo::kSemiMinorAxis * geo::kSemiMinorAxis / geo::kSemiMajorAxis;

// Ground up to 100 km from the ellipsoid turns by that much more of a step than the ellipsoid does.
constexpr double kHeights = 1.02;

// Lattice columns and rows, from the tile's south-western sample.
struct Place {
  double x = 0, y = 0;
};

Place Between(Place a, Place b, double t) { return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)}; }

// The tile's ground about a place, cheaper than sines: exact at lattice nodes, and from the nearest one by series that
// end at the fifth power of half a cell, which is below 3e-9 for the widest cells there are.
class Ground {
 public:
  explicit Ground(const LatticeView& lattice) : step_(geo::ToRadians(lattice.lattice.StepDegrees())) {
    for (int i = 0; i <= lattice.cells(); ++i) columns_.push_back(geo::SurfaceNormal(lattice.Longitude(i), 0));
    for (int j = 0; j <= lattice.cells(); ++j) rows_.push_back(geo::SurfaceNormal(0, lattice.Latitude(j)));
  }

  // Metres above the ellipsoid of a point near the place, along the normal there.
  double HeightOf(const geo::Vec3& point, Place place) const {
    const Angle longitude = Turn(columns_, place.x, [](const geo::Vec3& up) { return Angle{up.x, up.y}; });
    const Angle latitude = Turn(rows_, place.y, [](const geo::Vec3& up) { return Angle{up.x, up.z}; });
    const double surface =
        geo::kSemiMajorAxis * std::sqrt(1 - geo::kEccentricitySquared * latitude.sine * latitude.sine);
    return latitude.cosine * (point.x * longitude.cosine + point.y * longitude.sine) + point.z * latitude.sine -
           surface;
  }

  // Metres along a row and along a column, at most.
  Place WidestStep() const {
    double widest = 0;
    for (const geo::Vec3& up : rows_) widest = std::max(widest, up.x);
    constexpr double kLargestRadius = geo::kSemiMajorAxis * geo::kSemiMajorAxis / geo::kSemiMinorAxis;
    return {widest * step_ * kLargestRadius, step_ * kLargestRadius};
  }
  // Metres, at most.
  double WidestDiagonal() const {
    const Place step = WidestStep();
    return std::hypot(step.x, step.y);
  }
  double step_radians() const { return step_; }

 private:
  struct Angle {
    double cosine = 1, sine = 0;
  };

  template <typename Read>
  Angle Turn(const std::vector<geo::Vec3>& nodes, double at, const Read& read) const {
    const auto nearest = static_cast<std::size_t>(std::lround(at));
    const double a = (at - static_cast<double>(nearest)) * step_, a2 = a * a;
    const double cosine = 1 - a2 / 2 * (1 - a2 / 12), sine = a * (1 - a2 / 6 * (1 - a2 / 20));
    const Angle node = read(nodes[nearest]);
    return {node.cosine * cosine - node.sine * sine, node.sine * cosine + node.cosine * sine};
  }

  double step_;
  std::vector<geo::Vec3> columns_, rows_;  // normals on the equator, on the zero meridian
};

// A piece of an edge within one lattice cell: the lattice surface on it is a quadratic, the edge's own height is
// linear.
struct Piece {
  double begin = 0, end = 0;  // of the edge, 0 .. 1
  double bend = 0;            // the quadratic's leading coefficient along the whole edge
};

// The larger of `known` and the largest |value| of the quadratic with these values at the ends of the piece.
double LargestOn(const Piece& piece, double first, double last, double known) {
  const double ends = std::max({std::abs(first), std::abs(last), known});
  const double length = piece.end - piece.begin, bend = piece.bend * length * length;
  // It leaves the line between its ends by a quarter of the bend at most.
  if (bend == 0 || std::max(std::abs(first), std::abs(last)) + std::abs(bend) / 4 <= ends) return ends;
  // first + (last - first) s + bend s (s - 1)
  const double s = 0.5 - (last - first) / (2 * bend);
  if (!(s > 0 && s < 1)) return ends;
  return std::max(ends, std::abs(first + (last - first) * s + bend * s * (s - 1)));
}

class EdgeMeter {
 public:
  explicit EdgeMeter(const LatticeView& lattice) : lattice_(lattice), cells_(lattice.cells()) {}

  // Every place where the edge a - b leaves a cell, in order, and its ends: visit(piece, from, to).
  template <typename Visit>
  void ForEachPiece(Place a, Place b, const Visit& visit) const {
    crossings_.clear();
    AddCrossings(a.x, b.x);
    const auto middle = static_cast<std::ptrdiff_t>(crossings_.size());
    AddCrossings(a.y, b.y);
    std::inplace_merge(crossings_.begin(), crossings_.begin() + middle, crossings_.end());
    crossings_.push_back(1);
    double begin = 0;
    for (const double end : crossings_) {
      if (!(end > begin)) continue;
      const Place centre = Between(a, b, (begin + end) / 2);
      visit(Piece{begin, end, Twist(CellOf(centre.x), CellOf(centre.y)) * (b.x - a.x) * (b.y - a.y)});
      begin = end;
    }
  }

  double SampleAt(Place place) const {
    const int i = CellOf(place.x), j = CellOf(place.y);
    const double x = place.x - i, y = place.y - j;
    const double south = lattice_.At(i, j) + x * (double{lattice_.At(i + 1, j)} - lattice_.At(i, j));
    const double north = lattice_.At(i, j + 1) + x * (double{lattice_.At(i + 1, j + 1)} - lattice_.At(i, j + 1));
    return south + y * (north - south);
  }

  bool IsRim(Place a, Place b) const {
    return (a.x == b.x && (a.x == 0 || a.x == cells_)) || (a.y == b.y && (a.y == 0 || a.y == cells_));
  }

 private:
  int CellOf(double at) const { return std::clamp(static_cast<int>(at), 0, cells_ - 1); }

  double Twist(int i, int j) const {
    return double{lattice_.At(i, j)} - lattice_.At(i + 1, j) - lattice_.At(i, j + 1) + lattice_.At(i + 1, j + 1);
  }

  void AddCrossings(double from, double to) const {
    if (from == to) return;
    const double inverse = 1 / (to - from);
    if (from < to) {
      for (double line = std::floor(from) + 1; line < to; ++line) crossings_.push_back((line - from) * inverse);
    } else {
      for (double line = std::ceil(from) - 1; line > to; --line) crossings_.push_back((line - from) * inverse);
    }
  }

  const LatticeView& lattice_;
  const int cells_;
  mutable std::vector<double> crossings_;
};

// Every edge once: those inside the tile belong to two triangles with opposite directions.
template <typename Visit>
void ForEachEdge(const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::vector<Place>& places,
                 const EdgeMeter& meter, const Visit& visit) {
  for (const auto& triangle : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[k], b = triangle[(k + 1) % 3];
      if (a < b || meter.IsRim(places[a], places[b])) visit(a, b);
    }
  }
}

double PlanarError(const EdgeMeter& meter, const std::vector<Place>& places, const std::vector<double>& heights,
                   const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  double largest = 0;
  ForEachEdge(triangles, places, meter, [&](std::uint32_t a, std::uint32_t b) {
    double before = heights[a] - meter.SampleAt(places[a]);
    meter.ForEachPiece(places[a], places[b], [&](const Piece& piece) {
      const double at_end =
          heights[a] + piece.end * (heights[b] - heights[a]) - meter.SampleAt(Between(places[a], places[b], piece.end));
      // The surface is subtracted, and so is its bend.
      largest = LargestOn({piece.begin, piece.end, -piece.bend}, before, at_end, largest);
      before = at_end;
    });
  });
  return largest;
}

// How far edges span, by the sum of their degrees in longitude and latitude: radians.
double WidestSpan(const EdgeMeter& meter, const std::vector<Place>& places,
                  const std::vector<std::array<std::uint32_t, 3>>& triangles, double step) {
  double widest = 0;
  ForEachEdge(triangles, places, meter, [&](std::uint32_t a, std::uint32_t b) {
    widest = std::max(widest, std::abs(places[a].x - places[b].x) + std::abs(places[a].y - places[b].y));
  });
  return widest * step;
}

// Metres: the largest of the smallest circles around triangles, about the middle of the longest edge or through all
// vertices. `step`: of a lattice step of either axis, at most.
double WidestCircle(const std::vector<Place>& places, const std::vector<std::array<std::uint32_t, 3>>& triangles,
                    const Place& step) {
  double widest = 0;  // squared
  for (const auto& triangle : triangles) {
    std::array<double, 3> sides{};  // squared
    for (std::size_t k = 0; k < 3; ++k) {
      const Place &a = places[triangle[k]], &b = places[triangle[(k + 1) % 3]];
      const double x = (a.x - b.x) * step.x, y = (a.y - b.y) * step.y;
      sides[k] = x * x + y * y;
    }
    const auto [a, b, c] = sides;
    const double longest = std::max({a, b, c});
    const double area = 2 * (a * b + b * c + c * a) - (a * a + b * b + c * c);  // its square, times 16
    const bool is_obtuse = 2 * longest >= a + b + c;
    widest = std::max(widest, is_obtuse || area <= 0 ? longest / 4 : std::min(longest / 3, a * b * c / area));
  }
  return std::sqrt(widest);
}

// Measured at the ends of pieces, where the edge's point in space is the chord's. Between them, and on the triangles
// between edges, the height of a chord strays from a linear one by at most what the last lines add.
double CurvedError(const EdgeMeter& meter, const Ground& ground, const std::vector<Place>& places,
                   const std::vector<geo::Vec3>& ecef, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  double largest = 0;
  ForEachEdge(triangles, places, meter, [&](std::uint32_t a, std::uint32_t b) {
    const geo::Vec3 along = ecef[b] - ecef[a];
    double before = ground.HeightOf(ecef[a], places[a]) - meter.SampleAt(places[a]);
    meter.ForEachPiece(places[a], places[b], [&](const Piece& piece) {
      const Place end = Between(places[a], places[b], piece.end);
      const double at_end = ground.HeightOf(ecef[a] + along * piece.end, end) - meter.SampleAt(end);
      largest = LargestOn({piece.begin, piece.end, -piece.bend}, before, at_end, largest);
      before = at_end;
    });
  });
  const double diagonal = ground.WidestDiagonal(), span = WidestSpan(meter, places, triangles, ground.step_radians());
  return largest + kHeights * (0.75 * diagonal * diagonal / kSmallestRadius + span * span / 8 * diagonal);
}

}  // namespace

double MeasureEdgeError(const LatticeView& lattice, const QuantizedTile& tile, bool curved) {
  const EdgeMeter meter(lattice);
  const Ground ground(lattice);
  std::vector<Place> places;
  std::vector<double> heights;
  const double scale = static_cast<double>(lattice.cells()) / kQuantizedMax;
  for (std::size_t k = 0; k < tile.u.size(); ++k) {
    places.push_back({tile.u[k] * scale, tile.v[k] * scale});
    heights.push_back(HeightAt(tile, tile.h[k]));
  }
  const double planar = PlanarError(meter, places, heights, tile.triangles);
  if (curved) return std::max(planar, CurvedError(meter, ground, places, DecodePositions(tile), tile.triangles));
  // A function whose second derivatives are at most M strays from its linear interpolation on a triangle by at most
  // M r^2 / 2, r the radius of a circle around it.
  const double radius = WidestCircle(places, tile.triangles, ground.WidestStep());
  return planar + kHeights * radius * radius / (2 * kSmallestRadius);
}

double MeasureFlatEdgeError(const LatticeView& lattice, const tin::TinMesh& mesh,
                            const std::vector<geo::Vec3>& positions) {
  std::vector<Place> places;
  for (const tin::SamplePosition p : mesh.vertices) {
    places.push_back({static_cast<double>(p.x), static_cast<double>(p.y)});
  }
  return CurvedError(EdgeMeter(lattice), Ground(lattice), places, positions, mesh.triangles);
}

}  // namespace terrace::proto
