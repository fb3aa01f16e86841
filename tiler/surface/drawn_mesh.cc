#include "tiler/surface/drawn_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::tiler {
namespace {

// Barycentric coordinates: a point this far outside counts as inside, so that no point falls between two triangles.
constexpr double kSlack = 1e-9;

double SideDegrees(const geo::TileKey& key) { return 180.0 / static_cast<double>(geo::TileRows(key.level)); }

}  // namespace

struct DrawnMesh::PlumbLine {
  geo::Vec3 start, up;  // from the mesh's origin; unit
};

// The triangle that the line meets farthest inside, or passes nearest by.
struct DrawnMesh::Meeting {
  double inside = -std::numeric_limits<double>::infinity();      // the smallest barycentric coordinate
  double distance_m = -std::numeric_limits<double>::infinity();  // to the nearest edge; negative outside
  double height_m = 0;
  std::uint32_t triangle = 0;
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
  const auto bucket = [this](double place) { return std::clamp(static_cast<int>(place * side_), 0, side_ - 1); };
  const auto buckets_of = [&](const std::array<std::uint32_t, 3>& triangle) {
    const auto [west, east] = std::minmax({places[triangle[0]][0], places[triangle[1]][0], places[triangle[2]][0]});
    const auto [south, north] = std::minmax({places[triangle[0]][1], places[triangle[1]][1], places[triangle[2]][1]});
    const double width = east - west, height = north - south;
    const double grown = 1e-6 + std::min(1.0, width * side * (width + height * slope) / 4);
    return Buckets{bucket(west - grown), bucket(south - grown), bucket(east + grown), bucket(north + grown)};
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
  const auto bucket = [this](double place) { return std::clamp(static_cast<int>(place * side_), 0, side_ - 1); };
  const int column = bucket(u), row = bucket(v);
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
  if (inside >= -kSlack) {
    if (inside > best.inside) best = {inside, 0, met->height_m, triangle};
    return;
  }
  if (best.inside >= -kSlack) return;
  const auto& [a, b, c] = triangles_[triangle];
  const geo::Vec3 ab = positions_[b] - positions_[a], ac = positions_[c] - positions_[a];
  const double longest = std::max({geo::Length(ab), geo::Length(ac), geo::Length(ac - ab)});
  const double distance_m = inside * geo::Length(geo::Cross(ab, ac)) / longest;
  if (distance_m > best.distance_m) best = {inside, distance_m, met->height_m, triangle};
}

DrawnPoint DrawnMesh::PointOf(const Meeting& met) const {
  const bool is_beside = met.inside < -kSlack;
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
  return best.inside < -kSlack ? std::nullopt : std::optional(PointOf(best));
}

// Whether a point is farther from the tile's northern and southern edge than any chord of these parallels is.
bool DrawnMesh::IsFarFromParallels(const dem::GeoPosition& point) const {
  const double v = PlaceOf(point)[1], side = geo::ToRadians(SideDegrees(key_));
  const double latitude = std::min(89.9, std::abs(point.latitude) + SideDegrees(key_));
  const double chord = side * std::tan(geo::ToRadians(latitude)) / 8;  // in tiles: side^2 cos sin / 8 over side
  return v > chord + 1e-6 && v < 1 - chord - 1e-6;
}

DrawnPoint DrawnMesh::Nearest(const dem::GeoPosition& point) const {
  const PlumbLine line = LineAt(point);
  Meeting best;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) Meet(line, t, best);
  DrawnPoint nearest = PointOf(best);
  if (lacks_holes_ && nearest.is_beside && IsFarFromParallels(point)) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    return {kNone, {kNone, kNone, kNone}, false};
  }
  return nearest;
}

}  // namespace terrace::tiler
