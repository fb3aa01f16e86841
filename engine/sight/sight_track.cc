#include "engine/sight/sight_track.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "engine/geo/ellipsoid.h"
#include "engine/sight/ray_course.h"

namespace terrace::dem {
namespace {

// `degrees`, moved by whole turns to within half a turn of `near`.
double Near(double degrees, double near, double turn) {
  return turn > 0 ? near + std::remainder(degrees - near, turn) : degrees;
}

bool IsKnown(const Position& position) { return !std::isnan(position.x + position.y); }

// Pixels on the axis where it is longer; infinity if one of the two positions alone is known.
double StepBetween(const Position& first, const Position& last) {
  if (IsKnown(first) != IsKnown(last)) return std::numeric_limits<double>::infinity();
  return IsKnown(first) ? std::max(std::abs(last.x - first.x), std::abs(last.y - first.y)) : 0;
}

TrackPiece PartOf(const TrackPiece& piece, double first, double last) {
  const double length = piece.end - piece.start;
  return {.start = piece.start + first * length,
          .end = last == 1 ? piece.end : piece.start + last * length,
          .length_m = (last - first) * piece.length_m,
          .longitude = piece.longitude.Part(first, last),
          .latitude = piece.latitude.Part(first, last),
          .height_m = piece.height_m.Part(first, last)};
}

// A ray on a grid, piece by piece.
class GridTrack {
 public:
  explicit GridTrack(const Georeference& georeference) : georeference_(georeference) {}

  // Adds a piece with its positions in pixels at 0, 0.5 and 1, as ToPixels gives them.
  void Add(const TrackPiece& piece, std::array<Position, 3> pixels) {
    for (Position& position : pixels) Unwrap(position);
    Divide(piece, pixels, kMaxDivisions);
  }
  std::vector<PieceOnGrid> Take() { return std::move(pieces_); }

 private:
  static constexpr int kMaxDivisions = 3;  // one in another: places may be erratic far from a projection's centre
  static constexpr int kHalvings = 40;     // of half a piece: to less than a micrometre

  // The places on both sides of a break, and their positions.
  struct Break {
    double before, after;
    Position from, to;
  };

  void Unwrap(Position& position) {
    if (georeference_.wrap_columns() == 0 || !IsKnown(position)) return;
    if (!std::isnan(last_x_)) position.x = Near(position.x, last_x_, georeference_.period());
    last_x_ = position.x;
  }

  Position At(const TrackPiece& piece, double s) {
    Position position{piece.longitude.At(s), piece.latitude.At(s)};
    georeference_.ToPixels({&position, 1});
    Unwrap(position);
    return position;
  }

  // The halves of a polynomial of a few kilometres are about equally long.
  static bool MayBreak(const std::array<Position, 3>& p) {
    const double first = StepBetween(p[0], p[1]), second = StepBetween(p[1], p[2]);
    if (std::isinf(first) || std::isinf(second)) return true;
    const double bend = std::max(std::abs(p[0].x - 2 * p[1].x + p[2].x), std::abs(p[0].y - 2 * p[1].y + p[2].y));
    return bend > 1 + std::max(first, second) / 2;
  }

  // At a break the step stays however short the part around it is.
  std::optional<Break> FindBreak(const TrackPiece& piece, Break around) {
    for (int halving = 0; halving < kHalvings && StepBetween(around.from, around.to) > 1; ++halving) {
      const double middle = (around.before + around.after) / 2;
      const Position there = At(piece, middle);
      if (StepBetween(around.from, there) > StepBetween(there, around.to)) {
        around.after = middle, around.to = there;
      } else {
        around.before = middle, around.from = there;
      }
    }
    if (!(StepBetween(around.from, around.to) > 1)) return std::nullopt;
    return around;
  }

  void Divide(const TrackPiece& piece, const std::array<Position, 3>& p, int divisions) {
    std::optional<Break> found;
    if (divisions > 0 && MayBreak(p)) {
      found = FindBreak(piece, {0, 0.5, p[0], p[1]});
      if (!found) found = FindBreak(piece, {0.5, 1, p[1], p[2]});
    }
    if (!found) {
      pieces_.push_back(
          {piece, {p[0].x - 0.5, p[1].x - 0.5, p[2].x - 0.5}, {p[0].y - 0.5, p[1].y - 0.5, p[2].y - 0.5}});
      return;
    }
    TrackPiece before = PartOf(piece, 0, found->before), after = PartOf(piece, found->after, 1);
    after.start = before.end;
    if (before.start < before.end) Divide(before, {p[0], At(before, 0.5), found->from}, divisions - 1);
    if (after.start < after.end) Divide(after, {found->to, At(after, 0.5), p[2]}, divisions - 1);
  }

  const Georeference& georeference_;
  double last_x_ = std::numeric_limits<double>::quiet_NaN();  // the last known one
  std::vector<PieceOnGrid> pieces_;
};

// The distance of a part of a chord from the axis of the Earth, metres.
double DistanceFromAxis(const geo::Vec3& from, const geo::Vec3& to) {
  const double x = to.x - from.x, y = to.y - from.y, square = x * x + y * y;
  const double nearest = square > 0 ? std::clamp(-(from.x * x + from.y * y) / square, 0.0, 1.0) : 0;
  return std::hypot(from.x + nearest * x, from.y + nearest * y);
}

// The longest piece at this distance from the axis, along the plane of the equator. Longitudes along a chord at
// distance r have a third derivative of at most 2 / r^3, so a polynomial of the second degree through three of them is
// at most h^3 / 62 r^2 metres off over h metres. Refraction changes heights alone. Within two metres of a pole, pieces
// do not become shorter.
double LongestPiece(double from_axis_m) {
  constexpr double kMaxError = 1e-3, kMinLength = 0.5;  // metres
  return std::clamp(std::cbrt(62 * kMaxError * from_axis_m * from_axis_m), kMinLength, TrackPiece::kMaxLength);
}

// Adds the pieces of a part of a ray, in order.
void AddPieces(const RayCourse& course, double start, double end, std::vector<TrackPiece>& pieces) {
  const geo::Vec3 from = course.start() + course.way() * start, to = course.start() + course.way() * end;
  const double length_m = course.length_m() * (end - start);
  if (std::hypot(to.x - from.x, to.y - from.y) > LongestPiece(DistanceFromAxis(from, to))) {
    const double middle = (start + end) / 2;
    AddPieces(course, start, middle, pieces);
    AddPieces(course, middle, end, pieces);
    return;
  }
  const SightPoint first = course.At(start);
  SightPoint middle = course.At((start + end) / 2), last = course.At(end);
  const double before = pieces.empty() ? first.longitude : pieces.back().longitude.At(1);
  const double longitude = Near(first.longitude, before, 360);
  middle.longitude = Near(middle.longitude, longitude, 360);
  last.longitude = Near(last.longitude, middle.longitude, 360);
  const TrackPiece piece{.start = start,
                         .end = end,
                         .length_m = length_m,
                         .longitude = {longitude, middle.longitude, last.longitude},
                         .latitude = {first.latitude, middle.latitude, last.latitude},
                         .height_m = {first.height_m, middle.height_m, last.height_m}};
  if (std::abs(last.longitude - longitude) < 90) {
    pieces.push_back(piece);
    return;
  }
  // Half a metre at a pole: the ray changes from one meridian to another, and does not cross those between them.
  TrackPiece before_pole = PartOf(piece, 0, 0.5), behind_pole = PartOf(piece, 0.5, 1);
  before_pole.longitude = {longitude, longitude, longitude};
  behind_pole.longitude = {last.longitude, last.longitude, last.longitude};
  pieces.push_back(before_pole);
  pieces.push_back(behind_pole);
}

}  // namespace

std::vector<TrackPiece> PiecesOf(const SightRay& ray, const SightOptions& options) {
  const RayCourse course(ray, options);
  const int count = std::max(1, static_cast<int>(std::ceil(course.length_m() / TrackPiece::kMaxLength)));
  std::vector<TrackPiece> pieces;
  pieces.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    AddPieces(course, static_cast<double>(i) / count, static_cast<double>(i + 1) / count, pieces);
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
  GridTrack track(georeference);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    track.Add(pieces[i], {positions[2 * i], positions[2 * i + 1], positions[2 * i + 2]});
  }
  return track.Take();
}

}  // namespace terrace::dem
