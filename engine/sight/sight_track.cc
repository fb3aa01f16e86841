#include "engine/sight/sight_track.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/geo/ellipsoid.h"

namespace terrace::dem {
namespace {

// Geodetic position of a point in space, by Bowring's method (Survey Review 23(181), 1976) in two steps: exact to a
// micrometre within thousands of kilometres of the surface.
SightPoint ToGeodetic(const geo::Vec3& p) {
  constexpr double a = geo::kSemiMajorAxis, b = geo::kSemiMinorAxis, e2 = geo::kEccentricitySquared;
  constexpr double e2_of_b = (a * a - b * b) / (b * b);
  const double from_axis = std::hypot(p.x, p.y);
  double tangent = p.z * a / (from_axis * b);  // of the reduced latitude
  double sine = 0, cosine = 1;
  for (int step = 0; step < 2; ++step) {
    const double reduced_cosine = std::isfinite(tangent) ? 1 / std::sqrt(1 + tangent * tangent) : 0;
    const double reduced_sine = std::isfinite(tangent) ? tangent * reduced_cosine : std::copysign(1.0, p.z);
    const double y = p.z + e2_of_b * b * reduced_sine * reduced_sine * reduced_sine;
    const double x = from_axis - e2 * a * reduced_cosine * reduced_cosine * reduced_cosine;
    const double length = std::hypot(x, y);
    sine = y / length, cosine = x / length;
    tangent = b * sine / (a * cosine);
  }
  return {geo::ToDegrees(std::atan2(p.y, p.x)), geo::ToDegrees(std::atan2(sine, cosine)),
          from_axis * cosine + p.z * sine - a * std::sqrt(1 - e2 * sine * sine)};
}

// Where the air bends a ray, it lies above the chord by k * d * (D - d) / 2R.
class Course {
 public:
  Course(const SightRay& ray, const SightOptions& options)
      : start_(geo::ToEcef(ray.from.longitude, ray.from.latitude, ray.from.height_m)),
        way_(geo::ToEcef(ray.to.longitude, ray.to.latitude, ray.to.height_m) - start_),
        length_m_(geo::Length(way_)) {
    if (options.refraction == 0) return;
    const SightPoint middle = ToGeodetic(start_ + way_ * 0.5);
    // The Gaussian radius of curvature.
    const double prime = geo::PrimeVerticalRadius(middle.latitude);
    const double meridian =
        prime * prime * prime * (1 - geo::kEccentricitySquared) / (geo::kSemiMajorAxis * geo::kSemiMajorAxis);
    rise_ = options.refraction * length_m_ * length_m_ / (2 * std::sqrt(prime * meridian));
  }

  double length_m() const { return length_m_; }
  SightPoint At(double share) const {
    SightPoint point = ToGeodetic(start_ + way_ * share);
    point.height_m += rise_ * share * (1 - share);
    return point;
  }

 private:
  geo::Vec3 start_, way_;
  double length_m_, rise_ = 0;
};

// `degrees`, moved by whole turns to within half a turn of `near`.
double Near(double degrees, double near, double turn) {
  return turn > 0 ? near + std::remainder(degrees - near, turn) : degrees;
}

}  // namespace

Quadratic::Range Quadratic::Over(double first, double last) const {
  const double at_first = At(first), at_last = At(last);
  Range range{std::min(at_first, at_last), std::max(at_first, at_last)};
  if (Slope(first) * Slope(last) < 0) {
    const double value = At(-b_ / (2 * a_));
    range = {std::min(range.min, value), std::max(range.max, value)};
  }
  return range;
}

double Quadratic::Solve(double value, double first, double last) const {
  const double at_first = At(first), at_last = At(last);
  double s = at_last == at_first ? first : first + (value - at_first) / (at_last - at_first) * (last - first);
  for (int step = 0; step < 2; ++step) {
    const double slope = Slope(s);
    if (slope != 0) s -= (At(s) - value) / slope;
  }
  return std::clamp(s, first, last);
}

double LengthOf(const SightRay& ray) { return Course(ray, {}).length_m(); }

SightPoint PointAt(const SightRay& ray, double share, const SightOptions& options) {
  return Course(ray, options).At(share);
}

std::vector<TrackPiece> PiecesOf(const SightRay& ray, const SightOptions& options) {
  const Course course(ray, options);
  // Meridians converge towards a pole, and columns are not a smooth function of the distance any more.
  const double latitude = std::max(std::abs(ray.from.latitude), std::abs(ray.to.latitude));
  const double longest_m = TrackPiece::kMaxLength * std::clamp(2 * std::cos(geo::ToRadians(latitude)), 0.01, 1.0);
  const int count = std::max(1, static_cast<int>(std::ceil(course.length_m() / longest_m)));
  std::vector<TrackPiece> pieces(static_cast<std::size_t>(count));
  SightPoint first = course.At(0);
  for (int i = 0; i < count; ++i) {
    TrackPiece& piece = pieces[static_cast<std::size_t>(i)];
    piece.start = static_cast<double>(i) / count;
    piece.end = static_cast<double>(i + 1) / count;
    piece.length_m = course.length_m() / count;
    SightPoint middle = course.At((piece.start + piece.end) / 2), last = course.At(piece.end);
    middle.longitude = Near(middle.longitude, first.longitude, 360);
    last.longitude = Near(last.longitude, middle.longitude, 360);
    piece.longitude = {first.longitude, middle.longitude, last.longitude};
    piece.latitude = {first.latitude, middle.latitude, last.latitude};
    piece.height_m = {first.height_m, middle.height_m, last.height_m};
    first = last;
  }
  return pieces;
}

std::vector<PieceOnGrid> OnGrid(std::span<const TrackPiece> pieces, const Georeference& georeference) {
  std::vector<Position> positions;
  positions.reserve(pieces.size() * 2 + 1);
  for (const TrackPiece& piece : pieces) {
    for (const double s : {0.0, 0.5}) positions.push_back({piece.longitude.At(s), piece.latitude.At(s)});
  }
  positions.push_back({pieces.back().longitude.At(1), pieces.back().latitude.At(1)});
  georeference.ToPixels(positions);
  for (std::size_t i = 1; i < positions.size(); ++i) {
    positions[i].x = Near(positions[i].x, positions[i - 1].x, georeference.period());
  }
  std::vector<PieceOnGrid> on_grid(pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    std::array<Position, 3> p{positions[2 * i], positions[2 * i + 1], positions[2 * i + 2]};
    if (georeference.period() > 0 && georeference.wrap_columns() == 0) {
      const double moved = Near(p[1].x, georeference.width() / 2.0, georeference.period()) - p[1].x;
      for (Position& position : p) position.x += moved;
    }
    on_grid[i] = {{p[0].x - 0.5, p[1].x - 0.5, p[2].x - 0.5}, {p[0].y - 0.5, p[1].y - 0.5, p[2].y - 0.5}};
  }
  return on_grid;
}

}  // namespace terrace::dem
