#include "tiler/surface/drawn_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/sight/quadratic.h"
#include "engine/sight/ray_course.h"
#include "engine/sight/sight_search.h"

namespace terrace::tiler {
namespace {

// Metres: within a part of this length a ray is a parabola above the ellipsoid to a micrometre.
constexpr double kPartLength = 500;

// The place between `low` and `high` with this value, for At(low) < value <= At(high); `low` may be larger than `high`.
double Bisect(const dem::Quadratic& along, double value, double low, double high) {
  for (int step = 0; step < 50 && low != high; ++step) {
    const double half = (low + high) / 2;
    (along.At(half) < value ? low : high) = half;
  }
  return high;
}

// Adds the clearances of a part of a ray: `over`, between `from` and `to`, where s is the share start + s * length of
// the ray.
void AddClearances(const dem::Quadratic& over, double from, double to, double start, double length,
                   dem::SightSearch& search) {
  const auto share = [&](double s) { return start + s * length; };
  const double a = over.square_factor();
  const double vertex = a > 0 ? std::clamp(-over.Slope(0) / (2 * a), from, to) : from;
  for (const double s : {from, vertex, to}) search.Add(over.At(s), share(s));
  if (over.At(from) < -dem::kSightTolerance) {
    search.AddBlocked(share(from));
    return;
  }
  for (const double s : {vertex, to}) {
    if (over.At(s) >= -dem::kSightTolerance) continue;
    search.AddBlocked(share(Bisect(over, -dem::kSightTolerance, s, from)));
    return;
  }
}

// A part of the surface that one list of triangles covers: degrees.
struct Region {
  double west, south, east, north;

  bool Contains(const dem::GeoPosition& point) const {
    constexpr double kSlack = 1e-11;  // a micrometre: a ray along an edge is on both sides of it, by rounding
    return std::abs(std::remainder(point.longitude - (west + east) / 2, 360)) <= (east - west) / 2 + kSlack &&
           std::abs(point.latitude - (south + north) / 2) <= (north - south) / 2 + kSlack;
  }
};

// The part of a bucket within the child of its tile that contains the point. Beside this child another child may exist,
// and cover the rest of the bucket.
Region RegionAt(const DrawnMesh& mesh, const DrawnMesh::Bucket& bucket, const dem::GeoPosition& point, int deepest) {
  const geo::TileKey child = TileAt(point, std::min(deepest, mesh.key().level + 1));
  const double side = 180.0 / static_cast<double>(geo::TileRows(child.level));
  const double west = static_cast<double>(child.x) * side - 180, south = static_cast<double>(child.y) * side - 90;
  return {std::max(bucket.west, west), std::max(bucket.south, south), std::min(bucket.east, west + side),
          std::min(bucket.north, south + side)};
}

// Where the chord of a ray crosses the borders of regions: in space, because degrees along it are not smooth at poles.
class BorderCrossings {
 public:
  explicit BorderCrossings(const dem::RayCourse& ray) : start_(ray.start()), way_(ray.way()) {}

  // The first place after `share` where the ray may leave a region, as a share of its length; infinity if there is
  // none. The ray may also stay in the region there: the opposite meridian and the mirror image of a parallel count
  // too.
  double Next(const Region& region, double share) const {
    double next = std::numeric_limits<double>::infinity();
    const auto add = [&](double place) {
      if (place > share) next = std::min(next, place);
    };
    for (const double longitude : {region.west, region.east}) AddMeridian(longitude, add);
    for (const double latitude : {region.south, region.north}) AddParallel(latitude, add);
    return next;
  }

 private:
  // A meridian is a half plane.
  void AddMeridian(double longitude, const auto& add) const {
    const auto [sine, cosine] = geo::RoundedSinCos(longitude);
    add((start_.y * cosine - start_.x * sine) / (way_.x * sine - way_.y * cosine));
  }
  // The places of one geodetic latitude, at all heights, are a cone: the normals of the ellipsoid meet in one point of
  // the axis.
  void AddParallel(double latitude, const auto& add) const {
    const geo::SinCos angle = geo::RoundedSinCos(latitude);
    const auto [sine, cosine] = angle;
    const double z = start_.z + geo::kEccentricitySquared * geo::PrimeVerticalRadius(angle) * sine;
    const double s2 = sine * sine, c2 = cosine * cosine;
    const double a = (way_.x * way_.x + way_.y * way_.y) * s2 - way_.z * way_.z * c2;
    const double b = 2 * ((start_.x * way_.x + start_.y * way_.y) * s2 - z * way_.z * c2);
    const double c = (start_.x * start_.x + start_.y * start_.y) * s2 - z * z * c2;
    // If the line misses the cone, by rounding or by far, the places found divide the ray where it need not be divided.
    const double q = -(b + std::copysign(std::sqrt(std::max(0.0, b * b - 4 * a * c)), b)) / 2;
    add(q / a);
    add(c / q);
  }

  const geo::Vec3 start_, way_;
};

// Follows rays over the meshes of tiles.
class MeshWalk {
 public:
  MeshWalk(const HasTile& has_tile, int level, const dem::SightOptions& options, const FindMesh& find_mesh,
           const std::stop_token& stop)
      : tiles_(has_tile, level, "surface: the rays", find_mesh), options_(options), stop_(stop) {}

  // Divides a ray where it leaves a region.
  Result<dem::SightAnswer> Look(const dem::SightRay& ray) {
    dem::SightSearch search;
    has_gaps_ = false;
    const dem::RayCourse course(ray, options_);
    const BorderCrossings borders(course);
    const double length_m = course.length_m();
    const double min_step = length_m > 0 ? std::min(1.0, kMinStep / length_m) : 1;
    for (double share = 0; share < 1;) {
      // Near a pole a ray crosses many regions.
      if (stop_.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the rays any more");
      const double just_after = std::min(1.0, share + min_step / 2);  // not on the border where the part begins
      const dem::GeoPosition here = PlaceAt(course, just_after);
      const Result<std::uint32_t> tile = tiles_.numbers().NumberAt(here);
      if (!tile) return tl::unexpected(tile.error());
      const Result<const DrawnMesh*> mesh = tiles_.MeshOf(*tile);
      if (!mesh) return tl::unexpected(mesh.error());
      const DrawnMesh::Bucket bucket = (*mesh)->BucketAt(here);
      const Region region = RegionAt(**mesh, bucket, here, tiles_.numbers().level());
      double next = std::min({1.0, share + kPartLength / length_m, borders.Next(region, just_after)});
      while (next - share > min_step && !region.Contains(PlaceAt(course, (share + next) / 2)))
        next = (share + next) / 2;
      next = std::min(1.0, std::max(next, share + min_step));
      const Result<void> added = AddPart(course, {share, next}, *tile, **mesh, bucket.triangles, search);
      if (!added) return tl::unexpected(added.error());
      share = next;
    }
    return search.Answer(has_gaps_);
  }

 private:
  // Of a ray, as shares of its length, or of a part, as shares of the part.
  struct Interval {
    double from, to;

    double At(double s) const { return from + s * (to - from); }
  };

  static dem::GeoPosition PlaceAt(const dem::RayCourse& ray, double share) {
    const dem::SightPoint point = ray.At(share);
    return {point.longitude, point.latitude};
  }

  // `triangles` lie over the part, which is short enough that heights and barycentric coordinates along it are
  // polynomials of the second degree.
  Result<void> AddPart(const dem::RayCourse& ray, const Interval& part, std::uint32_t tile, const DrawnMesh& mesh,
                       std::span<const std::uint32_t> triangles, dem::SightSearch& search) {
    std::array<dem::SightPoint, 3> points;
    for (std::size_t i = 0; i < 3; ++i) points[i] = ray.At(part.At(static_cast<double>(i) / 2));
    const auto place = [&](std::size_t i) { return dem::GeoPosition{points[i].longitude, points[i].latitude}; };
    covered_.clear();
    constexpr double kSlack = DrawnMesh::kSlack;
    for (const std::uint32_t triangle : triangles) {
      const auto first = mesh.CrossingOf(triangle, place(0)), middle = mesh.CrossingOf(triangle, place(1)),
                 last = mesh.CrossingOf(triangle, place(2));
      if (!first || !middle || !last) continue;
      Interval over{0, 1};
      for (std::size_t k = 0; k < 3 && over.from <= over.to; ++k) {
        const dem::Quadratic inside{first->inside[k] + kSlack, middle->inside[k] + kSlack, last->inside[k] + kSlack};
        if (inside.At(over.from) < 0 && inside.At(over.to) < 0) over.from = 2;
        if (over.from > over.to) break;
        if (inside.At(over.from) < 0) {
          over.from = Bisect(inside, 0, over.from, over.to);
        } else if (inside.At(over.to) < 0) {
          over.to = Bisect(inside, 0, over.to, over.from);
        }
      }
      if (over.from > over.to) continue;
      covered_.push_back(over);
      if (mesh.IsInHole(triangle)) {
        has_gaps_ = true;
        continue;
      }
      const dem::Quadratic clearance{points[0].height_m - first->height_m, points[1].height_m - middle->height_m,
                                     points[2].height_m - last->height_m};
      AddClearances(clearance, over.from, over.to, part.from, part.to - part.from, search);
    }
    std::ranges::sort(covered_, {}, &Interval::from);
    covered_.push_back({1, 1});
    double reached = 0;
    for (const Interval& over : covered_) {
      if (over.from - reached > kMinBare) {
        const Result<void> added = AddBare(ray, {part.At(reached), part.At(over.from)}, tile, search);
        if (!added) return added;
      }
      reached = std::max(reached, over.to);
    }
    return {};
  }

  // A part above none of the triangles: beside the tile's edge, within the distance of a chord from its parallel, in a
  // hole, or where the list lacks a triangle.
  Result<void> AddBare(const dem::RayCourse& ray, const Interval& part, std::uint32_t tile, dem::SightSearch& search) {
    std::array<double, 3> over{};
    for (std::size_t i = 0; i < 3; ++i) {
      const dem::SightPoint point = ray.At(part.At(static_cast<double>(i) / 2));
      const Result<DrawnTiles::Reading> read = tiles_.ReadAt({point.longitude, point.latitude}, tile, stop_);
      if (!read) return tl::unexpected(read.error());
      over[i] = point.height_m - read->point.height_m;
      if (!std::isnan(over[i])) continue;
      has_gaps_ = true;
      return {};
    }
    AddClearances({over[0], over[1], over[2]}, 0, 1, part.from, part.to - part.from, search);
    return {};
  }

  static constexpr double kMinStep = 5e-4;  // metres: far above rounding; next to a pole, regions are narrower
  static constexpr double kMinBare = 1e-4;  // of a part: rounding makes shorter ones

  DrawnTiles tiles_;
  const dem::SightOptions& options_;
  const std::stop_token& stop_;
  std::vector<Interval> covered_;  // by triangles of the current part
  bool has_gaps_ = false;          // of the current ray
};

double TotalLength(std::span<const dem::SightRay> rays) {
  double length_m = 0;
  for (const dem::SightRay& ray : rays) length_m += dem::LengthOf(ray);
  return length_m;
}

}  // namespace

Result<void> CheckSamplesAlong(const dem::ElevationModel& model, std::span<const dem::SightRay> rays) {
  double spacing_m = std::numeric_limits<double>::infinity();
  for (const dem::RasterInfo& raster : model.info().sources) spacing_m = std::min(spacing_m, raster.spacing_m);
  const double samples = TotalLength(rays) / spacing_m;
  if (samples <= kMaxSamplesAlong) return {};
  return MakeError(
      ErrorCode::kInvalidArgument,
      "the rays together cross about {:.0f} samples of the dataset's finest source, and {:.0f} are the most "
      "for one request; ask for fewer or shorter rays",
      samples, kMaxSamplesAlong);
}

Result<void> CheckSamplesAlong(int level, std::span<const dem::SightRay> rays) {
  const double side_m = geo::MetresPerDegreeNorth(0) * 180 / static_cast<double>(geo::TileRows(level));
  const double samples = TotalLength(rays) / std::min(side_m / 256, kPartLength);
  if (samples <= kMaxSamplesAlong) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "the rays together cross about {:.0f} samples of tiles of level {}, and {:.0f} are the most for one "
                   "request; ask for fewer or shorter rays, or for a shallower level",
                   samples, level, kMaxSamplesAlong);
}

Result<std::vector<dem::SightAnswer>> LookAlongDrawn(const HasTile& has_tile, int level,
                                                     std::span<const dem::SightRay> rays,
                                                     const dem::SightOptions& options, const FindMesh& find_mesh,
                                                     const std::stop_token& stop) {
  MeshWalk walk(has_tile, level, options, find_mesh, stop);
  std::vector<dem::SightAnswer> answers;
  answers.reserve(rays.size());
  for (const dem::SightRay& ray : rays) {
    const Result<dem::SightAnswer> answer = walk.Look(ray);
    if (!answer) return tl::unexpected(answer.error());
    answers.push_back(*answer);
  }
  return answers;
}

}  // namespace terrace::tiler
