#include "tiler/surface/drawn_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::tiler {
namespace {

// Tiles of at most 11 degrees: the plumb lines of a tile are nearly parallel.
constexpr int kBoundedLevel = 4;

double SideDegrees(const geo::TileKey& key) { return 180.0 / static_cast<double>(geo::TileRows(key.level)); }

// Of a place in the tile, 0 .. 1. Places outside have the bucket at the edge.
int BucketOf(double place, int side) {
  return std::min(static_cast<int>(std::clamp(place, 0.0, 1.0) * side), side - 1);
}

// Tiles: at least the distance from a parallel of any of its chords.
double ChordAt(const geo::TileKey& key, double latitude) {
  const double farthest = std::min(89.9, std::abs(latitude) + SideDegrees(key));
  return geo::ToRadians(SideDegrees(key)) * std::tan(geo::ToRadians(farthest)) / 8;  // side^2 cos sin / 8 over side
}

}  // namespace

struct DrawnMesh::PlumbLine {
  geo::Vec3 start, up;  // from the mesh's origin; unit
};

// The triangle that the line meets farthest inside, or passes nearest by.
struct DrawnMesh::Meeting {
  double inside = -std::numeric_limits<double>::infinity();     // the smallest barycentric coordinate
  double distance_m = std::numeric_limits<double>::infinity();  // across the line; 0 inside
  double height_m = 0;
  std::uint32_t triangle = 0;

  bool is_met() const { return inside >= -DrawnMesh::kSlack; }
  void MeetOrPass(const DrawnMesh& mesh, const PlumbLine& line, std::uint32_t other);
  // The same of all triangles, or of the buckets around a position until no other can be as near. Of triangles that are
  // not met, those farther than `reach_m` do not matter.
  void MeetAll(const DrawnMesh& mesh, const PlumbLine& line);
  void MeetAround(const DrawnMesh& mesh, const PlumbLine& line, const dem::GeoPosition& point, double reach_m);
};

DrawnMesh::DrawnMesh(const geo::TileKey& key, DrawnTriangles triangles)
    : key_(key),
      positions_(std::move(triangles.positions)),
      triangles_(std::move(triangles.triangles)),
      in_hole_(std::move(triangles.in_hole)),
      holes_are_left_out_(triangles.holes_are_left_out) {
  if (!positions_.empty()) origin_ = positions_.front();
  for (geo::Vec3& position : positions_) position = position - origin_;
  FillBuckets(triangles.places);
}

std::size_t DrawnMesh::bytes() const {
  return positions_.size() * sizeof(positions_[0]) + triangles_.size() * sizeof(triangles_[0]) + in_hole_.size() +
         (bucket_starts_.size() + bucket_triangles_.size()) * sizeof(std::uint32_t);
}

// Sorts triangles into buckets by their boxes in the tile. The edges of flat triangles are not straight in degrees, so
// boxes grow by the distance of a chord from the straight line. Where that is not enough, InOwnBucket finds nothing. On
// shallow levels and near the poles a box covers many buckets; then buckets are larger, so that their memory stays
// proportional to that of the triangles.
void DrawnMesh::FillBuckets(const std::vector<std::array<double, 2>>& places) {
  constexpr int kMaxSide = 256;
  side_ = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(triangles_.size()))), 1, kMaxSide);
  const double side = geo::ToRadians(SideDegrees(key_));
  const double farthest = std::min(89.9, std::max(std::abs(static_cast<double>(key_.y) * SideDegrees(key_) - 90),
                                                  std::abs(static_cast<double>(key_.y + 1) * SideDegrees(key_) - 90)));
  const double slope = std::tan(geo::ToRadians(farthest));
  struct Buckets {
    int west, south, east, north;
  };
  const auto buckets_of = [&](const std::array<std::uint32_t, 3>& triangle) {
    const auto [west, east] = std::minmax({places[triangle[0]][0], places[triangle[1]][0], places[triangle[2]][0]});
    const auto [south, north] = std::minmax({places[triangle[0]][1], places[triangle[1]][1], places[triangle[2]][1]});
    const double width = east - west, height = north - south;
    const double grown = 1e-6 + std::min(1.0, width * side * (width + height * slope) / 4);
    return Buckets{BucketOf(west - grown, side_), BucketOf(south - grown, side_), BucketOf(east + grown, side_),
                   BucketOf(north + grown, side_)};
  };
  const auto entries = [&] {
    std::size_t count = 0;
    for (const std::array<std::uint32_t, 3>& triangle : triangles_) {
      const Buckets at = buckets_of(triangle);
      count += static_cast<std::size_t>(at.east - at.west + 1) * static_cast<std::size_t>(at.north - at.south + 1);
    }
    return count;
  };
  while (side_ > 1 && entries() > 16 * triangles_.size() + 4096) side_ /= 2;
  const auto for_buckets = [&](const auto& visit) {
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
      const Buckets at = buckets_of(triangles_[t]);
      for (int row = at.south; row <= at.north; ++row) {
        for (int column = at.west; column <= at.east; ++column) {
          visit(static_cast<std::size_t>(row * side_ + column), t);
        }
      }
    }
  };
  bucket_starts_.assign(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_) + 1, 0);
  for_buckets([&](std::size_t bucket_index, std::uint32_t) { ++bucket_starts_[bucket_index + 1]; });
  for (std::size_t i = 1; i < bucket_starts_.size(); ++i) bucket_starts_[i] += bucket_starts_[i - 1];
  bucket_triangles_.resize(bucket_starts_.back());
  std::vector<std::uint32_t> next(bucket_starts_.begin(), bucket_starts_.end() - 1);
  for_buckets([&](std::size_t bucket_index, std::uint32_t t) { bucket_triangles_[next[bucket_index]++] = t; });
}

std::array<double, 2> DrawnMesh::PlaceOf(const dem::GeoPosition& point) const {
  const double side = SideDegrees(key_);
  const double longitude = point.longitude == 180 && key_.x == 0 ? -180 : point.longitude;
  return {(longitude + 180) / side - static_cast<double>(key_.x),
          (point.latitude + 90) / side - static_cast<double>(key_.y)};
}

DrawnMesh::Bucket DrawnMesh::BucketAt(const dem::GeoPosition& point) const {
  const auto [u, v] = PlaceOf(point);
  const int column = BucketOf(u, side_), row = BucketOf(v, side_);
  const auto index = static_cast<std::size_t>(row * side_ + column);
  const double side = SideDegrees(key_), step = side / side_;
  const double west = static_cast<double>(key_.x) * side - 180 + column * step;
  const double south = static_cast<double>(key_.y) * side - 90 + row * step;
  const std::span<const std::uint32_t> all(bucket_triangles_);
  return {west, south, west + step, south + step,
          all.subspan(bucket_starts_[index], bucket_starts_[index + 1] - bucket_starts_[index])};
}

DrawnMesh::PlumbLine DrawnMesh::LineAt(const dem::GeoPosition& point) const {
  return {geo::ToEcef(point.longitude, point.latitude, 0) - origin_,
          geo::SurfaceNormal(point.longitude, point.latitude)};
}

// The intersection of Möller and Trumbore (Journal of Graphics Tools 2(1), 1997), for both directions of the line.
std::optional<DrawnMesh::Crossing> DrawnMesh::Cross(const PlumbLine& line, std::uint32_t triangle) const {
  const auto& [a, b, c] = triangles_[triangle];
  const geo::Vec3 ab = positions_[b] - positions_[a], ac = positions_[c] - positions_[a];
  const geo::Vec3 across = geo::Cross(line.up, ac);
  const double determinant = geo::Dot(ab, across);  // minus twice the area seen from above; a triangle on edge has none
  // Positions are rounded to nanometres, so a triangle of a smaller width is noise. At a pole, corners at several
  // longitudes are one place.
  constexpr double kMinWidth = 1e-7;  // metres
  if (!(determinant < 0) ||
      determinant * determinant < kMinWidth * kMinWidth * std::max(geo::Dot(ab, ab), geo::Dot(ac, ac))) {
    return std::nullopt;
  }
  const geo::Vec3 from = line.start - positions_[a];
  const geo::Vec3 turned = geo::Cross(from, ab);
  const double of_b = geo::Dot(from, across) / determinant, of_c = geo::Dot(line.up, turned) / determinant;
  return Crossing{{1 - of_b - of_c, of_b, of_c}, geo::Dot(ac, turned) / determinant};
}

std::optional<DrawnMesh::Crossing> DrawnMesh::CrossingOf(std::uint32_t triangle, const dem::GeoPosition& point) const {
  return Cross(LineAt(point), triangle);
}

void DrawnMesh::Meet(const PlumbLine& line, std::uint32_t triangle, Meeting& best) const {
  const std::optional<Crossing> met = Cross(line, triangle);
  if (!met) return;
  const double inside = std::min({met->inside[0], met->inside[1], met->inside[2]});
  if (inside >= -kSlack && inside > best.inside) best = {inside, 0, met->height_m, triangle};
}

DrawnPoint DrawnMesh::PointOf(const Meeting& met) const {
  const bool is_beside = !met.is_met();
  if (IsInHole(met.triangle)) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    return {kNone, {kNone, kNone, kNone}, is_beside};
  }
  const auto& [a, b, c] = triangles_[met.triangle];
  return {met.height_m, geo::Normalized(geo::Cross(positions_[b] - positions_[a], positions_[c] - positions_[a])),
          is_beside};
}

std::optional<DrawnPoint> DrawnMesh::InOwnBucket(const dem::GeoPosition& point) const {
  const PlumbLine line = LineAt(point);
  Meeting best;
  for (const std::uint32_t triangle : BucketAt(point).triangles) Meet(line, triangle, best);
  return best.is_met() ? std::optional(PointOf(best)) : std::nullopt;
}

bool DrawnMesh::IsFarFromParallels(const dem::GeoPosition& point) const {
  const double v = PlaceOf(point)[1], chord = ChordAt(key_, point.latitude);
  return v > chord + 1e-6 && v < 1 - chord - 1e-6;
}

namespace {

// The point of a triangle that is nearest to a plumb line, which does not meet the triangle.
struct NearestPoint {
  double distance_m = std::numeric_limits<double>::infinity();  // in the plane across the line
  double height_m = 0;                                          // along the line
};

NearestPoint NearestPointOf(const std::array<geo::Vec3, 3>& triangle, const geo::Vec3& on_line, const geo::Vec3& up) {
  std::array<geo::Vec3, 3> corners;
  std::array<double, 3> heights;
  for (std::size_t k = 0; k < 3; ++k) {
    const geo::Vec3 from = triangle[k] - on_line;
    heights[k] = geo::Dot(from, up);
    corners[k] = from - up * heights[k];
  }
  NearestPoint best;
  for (std::size_t k = 0; k < 3; ++k) {
    const geo::Vec3 start = corners[k], along = corners[(k + 1) % 3] - start;
    const double length = geo::Dot(along, along);
    const double share = length > 0 ? std::clamp(-geo::Dot(start, along) / length, 0.0, 1.0) : 0;
    const geo::Vec3 nearest = start + along * share;
    const double distance_m = geo::Length(nearest);
    if (distance_m < best.distance_m) best = {distance_m, heights[k] + share * (heights[(k + 1) % 3] - heights[k])};
  }
  return best;
}

// A square of buckets around that of a place, `ring` to each side.
struct Square {
  int column, row, ring, side;  // `side`: buckets along the tile's edge

  // At least the distance of places beyond it from the plumb line of the place, in metres: meridians are planes, and
  // the radii of the ellipsoid are at least 6,300 km.
  double DistanceBeyond(const geo::TileKey& key, const std::array<double, 2>& place, double latitude) const {
    constexpr double kRadius = 6.3e6;
    const double radians = geo::ToRadians(SideDegrees(key));
    double nearest_m = std::numeric_limits<double>::infinity();
    const auto add = [&](int at, double where, double radius) {
      const double first = static_cast<double>(at - ring) / side, last = static_cast<double>(at + ring + 1) / side;
      if (at - ring > 0) nearest_m = std::min(nearest_m, radius * std::sin((where - first) * radians));
      if (at + ring + 1 < side) nearest_m = std::min(nearest_m, radius * std::sin((last - where) * radians));
    };
    add(column, place[0], kRadius * std::cos(geo::ToRadians(latitude)));
    add(row, place[1], kRadius);
    return nearest_m;
  }
};

}  // namespace

// Of triangles at one distance, as those around a vertex, the first counts.
void DrawnMesh::Meeting::MeetOrPass(const DrawnMesh& mesh, const PlumbLine& line, std::uint32_t other) {
  mesh.Meet(line, other, *this);
  if (is_met()) return;
  const auto& [a, b, c] = mesh.triangles_[other];
  const auto [away_m, at_m] =
      NearestPointOf({mesh.positions_[a], mesh.positions_[b], mesh.positions_[c]}, line.start, line.up);
  if (away_m > distance_m || (away_m == distance_m && other >= triangle)) return;
  if (!mesh.Cross(line, other)) return;
  distance_m = away_m, height_m = at_m, triangle = other;
}

void DrawnMesh::Meeting::MeetAll(const DrawnMesh& mesh, const PlumbLine& line) {
  for (std::uint32_t t = 0; t < mesh.triangles_.size(); ++t) MeetOrPass(mesh, line, t);
}

// Triangles in none of the square's buckets lie beyond it.
void DrawnMesh::Meeting::MeetAround(const DrawnMesh& mesh, const PlumbLine& line, const dem::GeoPosition& point,
                                    double reach_m) {
  const std::array<double, 2> place = mesh.PlaceOf(point);
  Square square{BucketOf(place[0], mesh.side_), BucketOf(place[1], mesh.side_), 0, mesh.side_};
  const auto visit = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= mesh.side_ || row >= mesh.side_) return;
    const auto bucket = static_cast<std::size_t>(row * mesh.side_ + column);
    for (std::uint32_t i = mesh.bucket_starts_[bucket]; i < mesh.bucket_starts_[bucket + 1]; ++i) {
      MeetOrPass(mesh, line, mesh.bucket_triangles_[i]);
    }
  };
  visit(square.column, square.row);
  for (square.ring = 1; square.ring < mesh.side_ && !is_met(); ++square.ring) {
    const int west = square.column - square.ring, east = square.column + square.ring;
    const int south = square.row - square.ring, north = square.row + square.ring;
    for (int column = west; column <= east; ++column) visit(column, south), visit(column, north);
    for (int row = south + 1; row < north; ++row) visit(west, row), visit(east, row);
    if (std::min(distance_m, reach_m) < square.DistanceBeyond(mesh.key_, place, point.latitude) / 2) break;
  }
}

DrawnPoint DrawnMesh::Nearest(const dem::GeoPosition& point) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const PlumbLine line = LineAt(point);
  const bool is_far_from_parallels = IsFarFromParallels(point);
  // What is farther than this from all triangles is a hole.
  double reach_m = std::numeric_limits<double>::infinity();
  if (holes_are_left_out_) {
    const double side_m = geo::ToRadians(SideDegrees(key_)) * geo::kSemiMajorAxis;
    reach_m = is_far_from_parallels ? 0 : ChordAt(key_, point.latitude) * side_m;
  }
  Meeting best;
  if (key_.level < kBoundedLevel) {
    best.MeetAll(*this, line);
  } else {
    best.MeetAround(*this, line, point, reach_m);
  }
  const bool is_drawn = best.is_met() || (best.distance_m <= reach_m && std::isfinite(best.distance_m));
  return is_drawn ? PointOf(best) : DrawnPoint{kNone, {kNone, kNone, kNone}, !is_far_from_parallels};
}

}  // namespace terrace::tiler
