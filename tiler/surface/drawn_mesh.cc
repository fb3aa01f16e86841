#include "tiler/surface/drawn_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::tiler {
namespace {

// Barycentric coordinates: a point this far outside counts as inside, so that no point falls between two triangles.
constexpr double kSlack = 1e-9;
// Tiles of at most 11 degrees: the plumb lines of a tile are nearly parallel.
constexpr int kBoundedLevel = 4;

double SideDegrees(const geo::TileKey& key) { return 180.0 / static_cast<double>(geo::TileRows(key.level)); }

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

  bool is_met() const { return inside >= -kSlack; }
};

DrawnMesh::DrawnMesh(const geo::TileKey& key, DrawnTriangles triangles)
    : key_(key),
      positions_(std::move(triangles.positions)),
      triangles_(std::move(triangles.triangles)),
      in_hole_(std::move(triangles.in_hole)),
      lacks_holes_(triangles.lacks_holes) {
  if (!positions_.empty()) origin_ = positions_.front();
  for (geo::Vec3& position : positions_) position = position - origin_;
  FillBuckets(triangles.places);
}

std::size_t DrawnMesh::bytes() const {
  return positions_.size() * sizeof(positions_[0]) + triangles_.size() * sizeof(triangles_[0]) + in_hole_.size() +
         (bucket_starts_.size() + bucket_triangles_.size()) * sizeof(std::uint32_t);
}

// Sorts triangles into buckets by their boxes in the tile. The edges of flat triangles are not straight in degrees, so
// boxes grow by the distance of a chord from the straight line. Where that is not enough, AtBucket finds nothing. On
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
    return Buckets{BucketOf(west - grown), BucketOf(south - grown), BucketOf(east + grown), BucketOf(north + grown)};
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
  const int column = BucketOf(u), row = BucketOf(v);
  const double side = SideDegrees(key_), step = side / side_;
  const double west = static_cast<double>(key_.x) * side - 180 + column * step;
  const double south = static_cast<double>(key_.y) * side - 90 + row * step;
  return {west, south, west + step, south + step, TrianglesIn(column, row)};
}

int DrawnMesh::BucketOf(double place) const { return std::clamp(static_cast<int>(place * side_), 0, side_ - 1); }

std::span<const std::uint32_t> DrawnMesh::TrianglesIn(int column, int row) const {
  const auto index = static_cast<std::size_t>(row * side_ + column);
  return std::span<const std::uint32_t>(bucket_triangles_)
      .subspan(bucket_starts_[index], bucket_starts_[index + 1] - bucket_starts_[index]);
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
  if (!(determinant < 0)) return std::nullopt;
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

// Of triangles at one distance, as those around a vertex, the first counts.
void DrawnMesh::MeetOrPass(const PlumbLine& line, std::uint32_t triangle, Meeting& best) const {
  Meet(line, triangle, best);
  if (best.is_met()) return;
  const double distance_m = DistanceOf(line, triangle);
  if (distance_m > best.distance_m || (distance_m == best.distance_m && triangle >= best.triangle)) return;
  const std::optional<Crossing> passed = Cross(line, triangle);
  if (!passed) return;
  best.distance_m = distance_m, best.height_m = passed->height_m, best.triangle = triangle;
}

// Of a triangle that the line does not meet, in the plane across the line.
double DrawnMesh::DistanceOf(const PlumbLine& line, std::uint32_t triangle) const {
  std::array<geo::Vec3, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    const geo::Vec3 from = positions_[triangles_[triangle][k]] - line.start;
    corners[k] = from - line.up * geo::Dot(from, line.up);
  }
  double squared = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    const geo::Vec3 start = corners[k], along = corners[(k + 1) % 3] - start;
    const double length = geo::Dot(along, along);
    const double share = length > 0 ? std::clamp(-geo::Dot(start, along) / length, 0.0, 1.0) : 0;
    const geo::Vec3 nearest = start + along * share;
    squared = std::min(squared, geo::Dot(nearest, nearest));
  }
  return std::sqrt(squared);
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

std::optional<DrawnPoint> DrawnMesh::AtBucket(const dem::GeoPosition& point) const {
  const PlumbLine line = LineAt(point);
  Meeting best;
  for (const std::uint32_t triangle : BucketAt(point).triangles) Meet(line, triangle, best);
  return best.is_met() ? std::optional(PointOf(best)) : std::nullopt;
}

// Tiles: at least the distance from a parallel of any of its chords.
double DrawnMesh::ChordAt(const dem::GeoPosition& point) const {
  const double side = geo::ToRadians(SideDegrees(key_));
  const double latitude = std::min(89.9, std::abs(point.latitude) + SideDegrees(key_));
  return side * std::tan(geo::ToRadians(latitude)) / 8;  // side^2 cos sin / 8 over side
}

// Goes from the point's bucket outwards. Triangles in no bucket so far lie beyond the square of these.
DrawnPoint DrawnMesh::Nearest(const dem::GeoPosition& point) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const PlumbLine line = LineAt(point);
  const auto [u, v] = PlaceOf(point);
  const double chord = ChordAt(point);
  const bool is_far_from_parallels = v > chord + 1e-6 && v < 1 - chord - 1e-6;
  // What is not drawn farther than this from all triangles is a hole.
  double reach_m = std::numeric_limits<double>::infinity();
  if (lacks_holes_)
    reach_m = is_far_from_parallels ? 0 : chord * geo::ToRadians(SideDegrees(key_)) * geo::kSemiMajorAxis;
  Meeting best;
  const auto visit = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= side_ || row >= side_) return;
    for (const std::uint32_t triangle : TrianglesIn(column, row)) MeetOrPass(line, triangle, best);
  };
  if (key_.level < kBoundedLevel) {
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) MeetOrPass(line, t, best);
  } else {
    const int column = BucketOf(u), row = BucketOf(v);
    visit(column, row);
    for (int ring = 1; ring < side_ && !best.is_met(); ++ring) {
      for (int x = column - ring; x <= column + ring; ++x) visit(x, row - ring), visit(x, row + ring);
      for (int y = row - ring + 1; y < row + ring; ++y) visit(column - ring, y), visit(column + ring, y);
      if (std::min(best.distance_m, reach_m) < DistanceBeyond(point, column, row, ring) / 2) break;
    }
  }
  const bool is_drawn = best.is_met() || (best.distance_m <= reach_m && std::isfinite(best.distance_m));
  return is_drawn ? PointOf(best) : DrawnPoint{kNone, {kNone, kNone, kNone}, !is_far_from_parallels};
}

// At least the distance of places beyond the square of buckets around one of them, in metres, from the plumb line:
// meridians are planes, and the radii of the ellipsoid are at least 6,300 km.
double DrawnMesh::DistanceBeyond(const dem::GeoPosition& point, int column, int row, int ring) const {
  constexpr double kRadius = 6.3e6;
  const double radians = geo::ToRadians(SideDegrees(key_)), side = side_;
  const double cosine = std::cos(geo::ToRadians(point.latitude));
  const auto [u, v] = PlaceOf(point);
  double nearest_m = std::numeric_limits<double>::infinity();
  const auto add = [&](int place, double at, double radius) {
    if (place - ring > 0) nearest_m = std::min(nearest_m, radius * std::sin((at - (place - ring) / side) * radians));
    if (place + ring + 1 < side_) {
      nearest_m = std::min(nearest_m, radius * std::sin(((place + ring + 1) / side - at) * radians));
    }
  };
  add(column, u, kRadius * cosine);
  add(row, v, kRadius);
  return nearest_m;
}

}  // namespace terrace::tiler
