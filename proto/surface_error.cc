#include "proto/surface_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "proto/lattice_angles.h"
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
  explicit Ground(const LatticeView& lattice)
      : step_(geo::ToRadians(lattice.lattice.StepDegrees())), angles_(lattice) {}

  // Metres above the ellipsoid of a point near the place, along the normal there.
  double HeightOf(const geo::Vec3& point, Place place) const {
    const geo::SinCos longitude = Turn(angles_.columns, place.x), latitude = Turn(angles_.rows, place.y);
    const double surface = geo::kSemiMajorAxis * std::sqrt(1 - geo::kEccentricitySquared * latitude.sin * latitude.sin);
    return latitude.cos * (point.x * longitude.cos + point.y * longitude.sin) + point.z * latitude.sin - surface;
  }

  // Metres along a row and along a column, at most.
  Place WidestStep() const {
    double widest = 0;
    for (const geo::SinCos& row : angles_.rows) widest = std::max(widest, row.cos);
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
  geo::SinCos Turn(const std::vector<geo::SinCos>& nodes, double at) const {
    const auto nearest = static_cast<std::size_t>(at + 0.5);
    const double a = (at - static_cast<double>(nearest)) * step_, a2 = a * a;
    const double cosine = 1 - a2 / 2 * (1 - a2 / 12), sine = a * (1 - a2 / 6 * (1 - a2 / 20));
    const geo::SinCos node = nodes[nearest];
    return {node.sin * cosine + node.cos * sine, node.cos * cosine - node.sin * sine};
  }

  double step_;
  LatticeAngles angles_;
};

// A piece of an edge within one lattice cell: the lattice surface on it is a quadratic.
struct Piece {
  double begin = 0, end = 0;  // of the edge, 0 .. 1
  double bend = 0;            // the quadratic's leading coefficient along the whole edge
  double end_sample = 0;      // of the lattice surface at the end
};

// Whether LargestOn may be more than `known`: a quadratic leaves the line between its ends by a quarter of its bend.
inline bool IsLarger(double length, double edge_bend, double first, double last, double known) {
  return std::max(std::abs(first), std::abs(last)) + std::abs(edge_bend) * length * length / 4 > known;
}

// The larger of `known` and the largest |value| of the quadratic with these values at the ends of a piece of that
// length. `edge_bend`: its leading coefficient along the whole edge.
double LargestOn(double length, double edge_bend, double first, double last, double known) {
  const double ends = std::max({std::abs(first), std::abs(last), known});
  const double bend = edge_bend * length * length;
  if (bend == 0) return ends;
  // first + (last - first) s + bend s (s - 1)
  const double s = 0.5 - (last - first) / (2 * bend);
  if (!(s > 0 && s < 1)) return ends;
  return std::max(ends, std::abs(first + (last - first) * s + bend * s * (s - 1)));
}

class EdgeMeter {
 public:
  explicit EdgeMeter(const LatticeView& lattice) : lattice_(lattice), cells_(lattice.cells()) {}

  // Every piece of the edge a - b between places where it leaves a cell, in order: visit(piece).
  template <typename Visit>
  void ForEachPiece(Place a, Place b, const Visit& visit) const {
    Lines columns(a.x, b.x), rows(a.y, b.y);
    const double turn = (b.x - a.x) * (b.y - a.y);
    for (double begin = 0; begin < 1;) {
      const double end = std::min(std::min(columns.at, rows.at), 1.0);
      if (columns.at <= end) columns.Next();
      if (rows.at <= end) rows.Next();
      if (!(end > begin)) continue;
      const Place centre = Between(a, b, (begin + end) / 2), last = Between(a, b, end);
      const int i = CellOf(centre.x), j = CellOf(centre.y);
      const double south_west = lattice_.At(i, j), along = lattice_.At(i + 1, j) - south_west;
      const double across = lattice_.At(i, j + 1) - south_west;
      const double twist = lattice_.At(i + 1, j + 1) - south_west - along - across;
      const double x = last.x - i, y = last.y - j;
      visit(Piece{begin, end, twist * turn, south_west + x * along + y * (across + x * twist)});
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

  // Where an edge crosses the lattice's lines of one direction, as parts of the edge; infinity after the last.
  struct Lines {
    Lines(double from, double to)
        : first(from), last(to), inverse(1 / (to - from)), line(from < to ? std::floor(from) : std::ceil(from)) {
      Next();
    }
    void Next() {
      line += first < last ? 1 : -1;
      const bool is_there = first < last ? line < last : line > last;
      at = is_there && first != last ? (line - first) * inverse : std::numeric_limits<double>::infinity();
    }
    double first, last, inverse, line, at = 0;
  };

  const LatticeView& lattice_;
  const int cells_;
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

// Lattice steps along both axes together.
double SpanOf(Place a, Place b) { return std::abs(a.x - b.x) + std::abs(a.y - b.y); }

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

// The flat triangles, by their heights above the ellipsoid along edges.
class Drawn {
 public:
  Drawn(const Ground& ground, const std::vector<Place>& places, const std::vector<geo::Vec3>& ecef)
      : ground_(ground), places_(places), ecef_(ecef) {
    heights_.reserve(ecef.size());
    for (std::size_t k = 0; k < ecef.size(); ++k) heights_.push_back(ground.HeightOf(ecef[k], places[k]));
  }

  // The height along an edge between its ends: a quadratic with that leading coefficient, but for `slack`.
  struct Edge {
    double first = 0, last = 0, bend = 0, slack = 0;
    bool is_quadratic = true;  // else it is to be told at every place

    double At(double t) const { return first + t * (last - first) + bend * t * (t - 1); }
  };

  // The height above the ellipsoid at a part t of the edge is n(t) P(t) - s(t): n the normal there, P the chord's
  // point, s how far the tangential plane is from the centre. Components of n are sums of sines of (longitude +-
  // latitude), so their k-th derivatives are at most w^k, w the edge's span in radians of both together. The third
  // derivative of the height is at most 3 |n''| |P'| + |n'''| |P| + |s'''| < 7.2 a w^3 + 5.3 w^2 |difference of
  // heights|. A quadratic through both ends and the middle is off by 0.0081 of it.
  Edge EdgeOf(std::uint32_t a, std::uint32_t b) const {
    const double span = SpanOf(places_[a], places_[b]) * ground_.step_radians();
    Edge edge{heights_[a], heights_[b]};
    constexpr double kWide = 0.01;  // the slack is up to 0.4 m below
    edge.is_quadratic = span < kWide;
    if (!edge.is_quadratic) return edge;
    const double middle = HeightOn(a, b, 0.5);
    edge.bend = 2 * (edge.first + edge.last) - 4 * middle;
    edge.slack = 0.0081 * span * span * (7.2 * geo::kSemiMajorAxis * span + 5.3 * std::abs(edge.last - edge.first));
    return edge;
  }

  double HeightOn(std::uint32_t a, std::uint32_t b, double t) const {
    return ground_.HeightOf(ecef_[a] + (ecef_[b] - ecef_[a]) * t, Between(places_[a], places_[b], t));
  }

 private:
  const Ground& ground_;
  const std::vector<Place>& places_;
  const std::vector<geo::Vec3>& ecef_;
  std::vector<double> heights_;  // by vertex
};

// The largest differences along edges from the lattice surface, metres, and the largest span of an edge.
struct Largest {
  double planar = 0, drawn = 0, span = 0;
};

// `heights`: by vertex, of the reading in longitude and latitude; empty: it is not measured. `drawn`: null, or the flat
// triangles, whose heights between the ends of pieces are for the caller to bound where edges are no quadratics.
Largest MeasureEdges(const EdgeMeter& meter, const std::vector<Place>& places, const std::vector<double>& heights,
                     const Drawn* drawn, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  Largest largest;
  std::vector<double> samples;  // of the lattice surface, by vertex
  samples.reserve(places.size());
  for (const Place place : places) samples.push_back(meter.SampleAt(place));
  ForEachEdge(triangles, places, meter, [&](std::uint32_t a, std::uint32_t b) {
    largest.span = std::max(largest.span, SpanOf(places[a], places[b]));
    const double sample = samples[a];
    const double first = heights.empty() ? 0 : heights[a], rise = heights.empty() ? 0 : heights[b] - heights[a];
    const Drawn::Edge edge = drawn != nullptr ? drawn->EdgeOf(a, b) : Drawn::Edge{};
    double planar = first - sample, flat = edge.first - sample, most = largest.drawn - edge.slack;
    meter.ForEachPiece(places[a], places[b], [&](const Piece& piece) {
      // The surface is subtracted, and so is its bend.
      const double length = piece.end - piece.begin;
      if (!heights.empty()) {
        const double at_end = first + piece.end * rise - piece.end_sample;
        if (IsLarger(length, -piece.bend, planar, at_end, largest.planar)) {
          largest.planar = LargestOn(length, -piece.bend, planar, at_end, largest.planar);
        }
        planar = at_end;
      }
      if (drawn != nullptr) {
        const double height = edge.is_quadratic ? edge.At(piece.end) : drawn->HeightOn(a, b, piece.end);
        const double at_end = height - piece.end_sample;
        const double bend = edge.bend - piece.bend;
        if (IsLarger(length, bend, flat, at_end, most)) most = LargestOn(length, bend, flat, at_end, most);
        flat = at_end;
      }
    });
    largest.drawn = std::max(largest.drawn, most + edge.slack);
  });
  return largest;
}

// Between the ends of pieces, and on the triangles between edges, the height of a chord strays from a linear one by at
// most this. `steps`: the largest span of an edge.
double Stray(const Ground& ground, double steps) {
  const double diagonal = ground.WidestDiagonal(), span = steps * ground.step_radians();
  return kHeights * (0.75 * diagonal * diagonal / kSmallestRadius + span * span / 8 * diagonal);
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
  if (curved) {
    const std::vector<geo::Vec3> ecef = DecodePositions(tile);
    const Drawn drawn(ground, places, ecef);
    const Largest largest = MeasureEdges(meter, places, heights, &drawn, tile.triangles);
    return std::max(largest.planar, largest.drawn + Stray(ground, largest.span));
  }
  const double planar = MeasureEdges(meter, places, heights, nullptr, tile.triangles).planar;
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
  const EdgeMeter meter(lattice);
  const Ground ground(lattice);
  const Drawn drawn(ground, places, positions);
  const Largest largest = MeasureEdges(meter, places, {}, &drawn, mesh.triangles);
  return largest.drawn + Stray(ground, largest.span);
}

}  // namespace terrace::proto
