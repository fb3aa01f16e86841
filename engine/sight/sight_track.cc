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

  static TrackPiece PartOf(const TrackPiece& piece, double first, double last) {
    const double length = piece.end - piece.start;
    return {.start = piece.start + first * length,
            .end = last == 1 ? piece.end : piece.start + last * length,
            .length_m = (last - first) * piece.length_m,
            .longitude = piece.longitude.Part(first, last),
            .latitude = piece.latitude.Part(first, last),
            .height_m = piece.height_m.Part(first, last)};
  }

  const Georeference& georeference_;
  double last_x_ = std::numeric_limits<double>::quiet_NaN();  // the last known one
  std::vector<PieceOnGrid> pieces_;
};

}  // namespace

std::vector<TrackPiece> PiecesOf(const SightRay& ray, const SightOptions& options) {
  const RayCourse course(ray, options);
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
  GridTrack track(georeference);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    track.Add(pieces[i], {positions[2 * i], positions[2 * i + 1], positions[2 * i + 2]});
  }
  return track.Take();
}

}  // namespace terrace::dem
