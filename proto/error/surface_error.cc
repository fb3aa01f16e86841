#include "proto/error/surface_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "proto/error/edge_bound.h"
#include "proto/error/node_verticals.h"
#include "proto/lattice_angles.h"
#include "proto/mesh/tile_geometry.h"

namespace terrace::proto {
namespace {

// The relative difference in curvature between the ellipsoid and ground up to 100 km from it.
constexpr double kCurvatureMargin = 1.02;

LatticePoint Between(LatticePoint a, LatticePoint b, double t) {
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
}

// Positions and normals of the tile's ground, without sines: exact at lattice nodes, and in between by series around
// the nearest node. The first omitted term is the fifth power of half a cell, below 3e-9 for the widest cells.
class Ground {
 public:
  explicit Ground(const TileSamples& samples)
      : step_(geo::ToRadians(samples.lattice.StepDegrees())),
        west_(geo::ToRadians(samples.Longitude(0))),
        south_(geo::ToRadians(samples.Latitude(0))),
        angles_(samples),
        narrowest_(std::min(angles_.rows.front().cos, angles_.rows.back().cos) - step_) {}

  // Metres above the ellipsoid of a point near the place, along the normal there.
  double HeightOf(const geo::Vec3& point, LatticePoint place) const {
    const geo::SinCos longitude = Turn(angles_.columns, place.x), latitude = Turn(angles_.rows, place.y);
    const double surface = geo::kSemiMajorAxis * std::sqrt(1 - geo::kEccentricitySquared * latitude.sin * latitude.sin);
    return latitude.cos * (point.x * longitude.cos + point.y * longitude.sin) + point.z * latitude.sin - surface;
  }

  // Upper bounds of the metres along a row and along a column.
  LatticePoint WidestStep() const {
    double widest = 0;
    for (const geo::SinCos& row : angles_.rows) widest = std::max(widest, row.cos);
    return {widest * step_ * geo::kLargestRadius, step_ * geo::kLargestRadius};
  }
  // Lower bounds of the same; not positive at a pole.
  LatticePoint NarrowestStep() const {
    double narrowest = 1;
    for (const geo::SinCos& row : angles_.rows) narrowest = std::min(narrowest, row.cos);
    return {std::max(narrowest, 1e-12) * step_ * geo::kSmallestRadius * 0.98, step_ * geo::kSmallestRadius * 0.98};
  }
  // Metres, an upper bound.
  double WidestDiagonal() const {
    const LatticePoint step = WidestStep();
    return std::hypot(step.x, step.y);
  }
  double step_radians() const { return step_; }

  // Where the plumb line through the point meets the ellipsoid (Bowring, "Transformation from spatial to geographical
  // coordinates", Survey Review 1976). `near`: a place within half a turn.
  LatticePoint PlaceOf(const geo::Vec3& point, LatticePoint near) const {
    constexpr double kSecond = geo::kEccentricitySquared / (1 - geo::kEccentricitySquared);
    const double radius = std::hypot(point.x, point.y);
    const double reduced = std::atan2(point.z * geo::kSemiMajorAxis, radius * geo::kSemiMinorAxis);
    const double sine = std::sin(reduced), cosine = std::cos(reduced);
    const double latitude =
        std::atan2(point.z + kSecond * geo::kSemiMinorAxis * sine * sine * sine,
                   radius - geo::kEccentricitySquared * geo::kSemiMajorAxis * cosine * cosine * cosine);
    const double turn = 2 * std::numbers::pi / step_;
    double x = (std::atan2(point.y, point.x) - west_) / step_;
    x -= std::round((x - near.x) / turn) * turn;
    return {x, (latitude - south_) / step_};
  }

  // A bound, in lattice steps, on the distance between the points of a chord and the line between the positions of its
  // ends. The chord is nearer to the axis than its ends. Its longitude is the mean of theirs weighted with the
  // distances from the axis, and its latitude the mean weighted with the radii of curvature. Infinite if no bound is
  // known.
  LatticePoint Shift(LatticePoint a, LatticePoint b, double rise_m) const {
    constexpr double kUnknown = std::numeric_limits<double>::infinity();
    const double width = std::abs(a.x - b.x) * step_, height = std::abs(a.y - b.y) * step_;
    if (width > 0.5) return {kUnknown, kUnknown};
    const double heights = std::abs(rise_m) / geo::kSmallestRadius;
    // width^2 sin cos / 8, times the ratio of the radii of curvature
    const double y = kCurvatureMargin * width * width / 16 + height * (heights / 4 + height * (0.005 + height));
    if (width == 0) return {0, y / step_};
    // For the whole tile if that is tight enough, else for the chord's rows.
    const double min_cosine = narrowest_ > 0.1 ? narrowest_ : std::min(RowNear(a.y).cos, RowNear(b.y).cos) - step_ / 2;
    if (min_cosine < height / 8 + 1e-9) return {kUnknown, kUnknown};  // about a pole
    return {width * (height / min_cosine / 4 + heights / 2 + width * width / 16) / step_, y / step_};
  }

 private:
  const geo::SinCos& RowNear(double y) const {
    return angles_.rows[std::min(static_cast<std::size_t>(std::max(y + 0.5, 0.0)), angles_.rows.size() - 1)];
  }
  geo::SinCos Turn(const std::vector<geo::SinCos>& nodes, double at) const {
    const double last = static_cast<double>(nodes.size() - 1);
    const auto nearest = static_cast<std::size_t>(std::clamp(at, 0.0, last) + 0.5);
    const geo::SinCos node = nodes[nearest];
    const double a = (at - static_cast<double>(nearest)) * step_, a2 = a * a;
    double cosine = 1 - a2 / 2 * (1 - a2 / 12), sine = a * (1 - a2 / 6 * (1 - a2 / 20));
    if (at < -0.5 || at > last + 0.5) cosine = std::cos(a), sine = std::sin(a);  // a chord that leaves the tile
    return {node.sin * cosine + node.cos * sine, node.cos * cosine - node.sin * sine};
  }

  double step_, west_, south_;  // radians
  LatticeAngles angles_;
  double narrowest_;  // the smallest cosine of a latitude, a step beyond the rows too
};

// A piece of an edge within one lattice cell: the lattice surface on it is a quadratic.
struct Piece {
  double begin = 0, end = 0;  // of the edge, 0 .. 1
  double bend = 0;            // the quadratic's leading coefficient along the whole edge
  double end_sample = 0;      // of the lattice surface at the end
};

// Whether LargestOn may exceed `known`: a quadratic deviates from the line between its ends by at most a quarter of its
// bend.
inline bool IsLarger(double length, double edge_bend, double first, double last, double known) {
  return std::max(std::abs(first), std::abs(last)) + std::abs(edge_bend) * length * length / 4 > known;
}

// Returns the larger of `known` and the largest |value| of a quadratic on a piece of the given length. The quadratic
// has the given values at the ends of the piece. `edge_bend`: its leading coefficient along the whole edge.
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
  EdgeMeter(const TileSamples& samples, const EdgeBound& bound)
      : samples_(samples), cells_(samples.cells()), steepest_{bound.steepest_east(), bound.steepest_north()} {}

  // An upper bound, in metres, on the change of the lattice surface over these steps.
  double LargestChange(LatticePoint steps) const {
    if (!std::isfinite(steps.x) || !std::isfinite(steps.y)) return Relief();
    const double change = steps.x * steepest_.x + steps.y * steepest_.y;
    return change <= std::max(steepest_.x, steepest_.y) ? change : std::min(change, Relief());
  }

  // Calls visit(piece) for every piece of the edge a - b within one cell, in order.
  template <typename Visit>
  void ForEachPiece(LatticePoint a, LatticePoint b, const Visit& visit) const {
    Lines columns(a.x, b.x), rows(a.y, b.y);
    const double turn = (b.x - a.x) * (b.y - a.y);
    for (double begin = 0; begin < 1;) {
      const double end = std::min(std::min(columns.at, rows.at), 1.0);
      if (columns.at <= end) columns.Next();
      if (rows.at <= end) rows.Next();
      if (!(end > begin)) continue;
      const LatticePoint centre = Between(a, b, (begin + end) / 2), last = Between(a, b, end);
      const int i = CellOf(centre.x), j = CellOf(centre.y);
      const double south_west = samples_.At(i, j), along = samples_.At(i + 1, j) - south_west;
      const double across = samples_.At(i, j + 1) - south_west;
      const double twist = samples_.At(i + 1, j + 1) - south_west - along - across;
      const double x = last.x - i, y = last.y - j;
      visit(Piece{begin, end, twist * turn, south_west + x * along + y * (across + x * twist)});
      begin = end;
    }
  }

  double SampleAt(LatticePoint place) const {
    const int i = CellOf(place.x), j = CellOf(place.y);
    const double x = place.x - i, y = place.y - j;
    const double south = samples_.At(i, j) + x * (double{samples_.At(i + 1, j)} - samples_.At(i, j));
    const double north = samples_.At(i, j + 1) + x * (double{samples_.At(i + 1, j + 1)} - samples_.At(i, j + 1));
    return south + y * (north - south);
  }

  bool IsRim(LatticePoint a, LatticePoint b) const {
    return (a.x == b.x && (a.x == 0 || a.x == cells_)) || (a.y == b.y && (a.y == 0 || a.y == cells_));
  }

 private:
  // Metres between the lowest and the highest node. Computed on demand, because few tiles need it.
  double Relief() const {
    if (relief_ < 0) {
      double lowest = samples_.At(0, 0), highest = lowest;
      for (int j = 0; j <= cells_; ++j) {
        for (int i = 0; i <= cells_; ++i) {
          const double height = samples_.At(i, j);
          lowest = std::min(lowest, height);
          highest = std::max(highest, height);
        }
      }
      relief_ = highest - lowest;
    }
    return relief_;
  }

  int CellOf(double at) const { return std::clamp(static_cast<int>(at), 0, cells_ - 1); }

  // The crossings of an edge with the lattice lines of one direction, as fractions of the edge; infinity after the
  // last.
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

  const TileSamples& samples_;
  const int cells_;
  LatticePoint steepest_;  // metres between neighbouring samples of a row and of a column
  mutable double relief_ = -1;
};

// Visits every edge once: inner edges belong to two triangles, with opposite directions.
template <typename Visit>
void ForEachEdge(const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::vector<LatticePoint>& places,
                 const EdgeMeter& meter, const Visit& visit) {
  for (const auto& triangle : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[k], b = triangle[(k + 1) % 3];
      if (a < b || meter.IsRim(places[a], places[b])) visit(a, b);
    }
  }
}

// Lattice steps along both axes together.
double SpanOf(LatticePoint a, LatticePoint b) { return std::abs(a.x - b.x) + std::abs(a.y - b.y); }

// A point of a flat triangle's edge.
struct End {
  LatticePoint place;  // where its plumb line meets the ellipsoid
  geo::Vec3 point;
  double height = 0;  // above the ellipsoid, metres
};

// The height of a chord above the ellipsoid along the line between its ends' places: a quadratic with the leading
// coefficient `bend`, within `slack`.
struct Chord {
  double first = 0, last = 0, bend = 0, slack = 0;
  bool is_quadratic = true;  // else it must be evaluated at every position

  double At(double t) const { return first + t * (last - first) + bend * t * (t - 1); }
};

double HeightOn(const Ground& ground, const End& a, const End& b, double t) {
  return ground.HeightOf(a.point + (b.point - a.point) * t, Between(a.place, b.place, t));
}

// The height above the ellipsoid at a part t of the chord is n(t) P(t) - s(t): n the normal there, P the chord's
// point, s how far the tangential plane is from the centre. Components of n are sums of sines of (longitude +-
// latitude), so their k-th derivatives are at most w^k, w the edge's span in radians of both together. The third
// derivative of the height is at most 3 |n''| |P'| + |n'''| |P| + |s'''| < 7.2 a w^3 + 5.3 w^2 |difference of
// heights|. A quadratic through both ends and the middle is off by 0.0081 of it.
Chord ChordOf(const Ground& ground, const End& a, const End& b) {
  const double span = SpanOf(a.place, b.place) * ground.step_radians();
  Chord chord{a.height, b.height};
  constexpr double kWide = 0.01;  // the slack is up to 0.4 m below
  chord.is_quadratic = span < kWide;
  if (!chord.is_quadratic) return chord;
  chord.bend = 2 * (chord.first + chord.last) - 4 * HeightOn(ground, a, b, 0.5);
  chord.slack = 0.0081 * span * span * (7.2 * geo::kSemiMajorAxis * span + 5.3 * std::abs(chord.last - chord.first));
  return chord;
}

// The larger of `known` and the largest difference from the lattice surface along the line between two places, of a
// height that is linear along it.
double LargestOfLine(const EdgeMeter& meter, LatticePoint a, LatticePoint b, double first, double last, double known) {
  double before = first - meter.SampleAt(a);
  meter.ForEachPiece(a, b, [&](const Piece& piece) {
    // Subtracts the surface and its bend.
    const double length = piece.end - piece.begin;
    const double at_end = first + piece.end * (last - first) - piece.end_sample;
    if (IsLarger(length, -piece.bend, before, at_end, known)) {
      known = LargestOn(length, -piece.bend, before, at_end, known);
    }
    before = at_end;
  });
  return known;
}

// The same for a chord whose points deviate from the line by at most `shift`. If its heights between the ends of pieces
// are no quadratics, the caller bounds them.
double LargestOfChord(const EdgeMeter& meter, const EdgeBound& bound, const Ground& ground, const End& a, const End& b,
                      LatticePoint shift, double known) {
  const Chord chord = ChordOf(ground, a, b);
  const double slack = chord.slack + meter.LargestChange(shift);
  // A quadratic leaves the line between its ends by at most a quarter of its bend.
  const auto at_most = [&] {
    return bound.Over(bound.EndAt(a.place, a.height), bound.EndAt(b.place, b.height)) + std::abs(chord.bend) / 4 +
           slack;
  };
  if (chord.is_quadratic && at_most() <= known) return std::max(known, known - slack + slack);  // as is rounded below
  double before = chord.first - meter.SampleAt(a.place), max_deviation = known - slack;
  meter.ForEachPiece(a.place, b.place, [&](const Piece& piece) {
    const double length = piece.end - piece.begin, bend = chord.bend - piece.bend;
    const double height = chord.is_quadratic ? chord.At(piece.end) : HeightOn(ground, a, b, piece.end);
    const double at_end = height - piece.end_sample;
    if (IsLarger(length, bend, before, at_end, max_deviation))
      max_deviation = LargestOn(length, bend, before, at_end, max_deviation);
    before = at_end;
  });
  return std::max(known, max_deviation + slack);
}

// Chords that deviate from the line between the positions of their ends are halved until the deviation is small.
double LargestOfHalves(const EdgeMeter& meter, const EdgeBound& bound, const Ground& ground, const End& a, const End& b,
                       int depth, double known) {
  constexpr double kSmall = 1e-3;  // of a lattice step
  constexpr int kDeepest = 8;
  const LatticePoint shift = ground.Shift(a.place, b.place, a.height - b.height);
  if ((shift.x <= kSmall && shift.y <= kSmall) || depth == kDeepest) {
    return LargestOfChord(meter, bound, ground, a, b, shift, known);
  }
  End middle;
  middle.point = (a.point + b.point) * 0.5;
  middle.place = ground.PlaceOf(middle.point, Between(a.place, b.place, 0.5));
  middle.height = ground.HeightOf(middle.point, middle.place);
  known = LargestOfHalves(meter, bound, ground, a, middle, depth + 1, known);
  return LargestOfHalves(meter, bound, ground, middle, b, depth + 1, known);
}

// A bound on the deviation of a chord's height from a linear one, between the ends of pieces and on the triangles
// between edges. `steps`: the largest span of an edge.
double ChordDeviation(const Ground& ground, double steps) {
  const double diagonal = ground.WidestDiagonal(), span = steps * ground.step_radians();
  return kCurvatureMargin * (0.75 * diagonal * diagonal / geo::kSmallestRadius + span * span / 8 * diagonal);
}

// The larger of `known_m`, at samples, and the largest difference along edges from the lattice surface, plus
// ChordDeviation.
// `heights`: by vertex, of the surface that is linear in longitude and latitude; empty: it is not measured. `ecef`: by
// vertex, of the flat triangles, which lie `beside_m` beside their places at most. In metres.
//
// A chord is at most its sagitta below the line between its ends, and the lattice surface changes little over its
// shift. Most chords are therefore known to stay below the largest difference found so far, and are not measured.
double MeasureEdges(const TileSamples& samples, const std::vector<LatticePoint>& places,
                    const std::vector<double>& heights, const std::vector<geo::Vec3>& ecef, double beside_m,
                    const std::vector<std::array<std::uint32_t, 3>>& triangles, double known_m) {
  const EdgeBound bound(samples);
  const EdgeMeter meter(samples, bound);
  const Ground ground(samples);
  std::vector<End> ends(places.size());
  std::vector<EdgeBound::End> bounded(places.size());
  for (std::size_t k = 0; k < places.size(); ++k) {
    ends[k] = {places[k], ecef[k], ground.HeightOf(ecef[k], places[k])};
    bounded[k] = bound.EndAt(places[k], heights.empty() ? ends[k].height : heights[k]);
  }
  double span = 0;
  ForEachEdge(triangles, places, meter,
              [&](std::uint32_t a, std::uint32_t b) { span = std::max(span, SpanOf(places[a], places[b])); });
  const LatticePoint step = ground.WidestStep(), narrowest = ground.NarrowestStep();
  const double deviation =
      ChordDeviation(ground, span) + meter.LargestChange({beside_m / narrowest.x, beside_m / narrowest.y});
  double largest = known_m + deviation;  // between the samples, inside of pieces
  ForEachEdge(triangles, places, meter, [&](std::uint32_t a, std::uint32_t b) {
    const double x = (places[a].x - places[b].x) * step.x, y = (places[a].y - places[b].y) * step.y;
    const double sagitta = kCurvatureMargin * (x * x + y * y) / (8 * geo::kSmallestRadius);
    const LatticePoint shift = ground.Shift(places[a], places[b], ends[a].height - ends[b].height);
    // If both surfaces are measured, their heights also differ by rounding.
    double rounding = 0;
    if (!heights.empty())
      rounding = std::max(std::abs(heights[a] - ends[a].height), std::abs(heights[b] - ends[b].height));
    const double beyond = sagitta + meter.LargestChange(shift) + rounding + deviation;
    const double known = std::max(largest - beyond, 0.0);
    // Beside cliffs `beyond` is large, so that the chord is measured in any case. Then the linear height counts only if
    // it is the largest.
    const bool may_stay = known + beyond <= largest;
    double linear = known;
    if (may_stay || !heights.empty()) {
      const double least = may_stay ? known : largest;
      if (bound.Over(bounded[a], bounded[b]) > least) {
        linear = LargestOfLine(meter, places[a], places[b], bounded[a].height, bounded[b].height, least);
      }
    }
    if (linear <= known && may_stay) return;
    if (!heights.empty() && linear > known) largest = std::max(largest, linear);
    const double halves = LargestOfHalves(meter, bound, ground, ends[a], ends[b], 0, largest - deviation);
    largest = std::max(largest, halves + deviation);
  });
  return largest;
}

}  // namespace

double MeasureSurfaceError(const TileSamples& samples, const QuantizedTile& tile,
                           const std::vector<geo::Vec3>& positions, double at_samples_m) {
  std::vector<LatticePoint> places;
  std::vector<double> heights;
  places.reserve(tile.u.size());
  heights.reserve(tile.u.size());
  const double scale = static_cast<double>(samples.cells()) / kQuantizedMax;
  for (std::size_t k = 0; k < tile.u.size(); ++k) {
    places.push_back({tile.u[k] * scale, tile.v[k] * scale});
    heights.push_back(HeightAt(tile, tile.h[k]));
  }
  return MeasureEdges(samples, places, heights, positions, 0, tile.triangles, at_samples_m);
}

double MeasureFlatSurfaceError(const TileSamples& samples, const tin::TinMesh& mesh,
                               const std::vector<geo::Vec3>& positions, double at_samples_m) {
  std::vector<LatticePoint> places;
  for (const tin::SamplePosition p : mesh.vertices) {
    places.push_back({static_cast<double>(p.x), static_cast<double>(p.y)});
  }
  const NodeVerticals plumb(samples);
  double beside_m = 0;
  for (std::size_t k = 0; k < positions.size(); ++k) {
    const tin::SamplePosition node = mesh.vertices[k];
    beside_m = std::max(beside_m, plumb.PositionOf(positions[k], node.x, node.y).beside_m);
  }
  return MeasureEdges(samples, places, {}, positions, beside_m, mesh.triangles, at_samples_m);
}

}  // namespace terrace::proto
