#include "tiler/surface/drawn_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace terrace::tiler {
namespace {

// Metres: within a part of this length a ray is straight in degrees to a few millimetres.
constexpr double kPartLength = 500;

// A value along a part of a ray, by its values at 0, 0.5 and 1: a polynomial of the second degree.
struct Along {
  double first, middle, last;

  double At(double s) const {
    const double a = 2 * (first + last) - 4 * middle;
    return (a * s + last - first - a) * s + first;
  }
  // The s with At(s) = value, for At(low) < value <= At(high); `low` may be larger than `high`.
  double Solve(double value, double low, double high) const {
    for (int step = 0; step < 50 && low != high; ++step) {
      const double half = (low + high) / 2;
      (At(half) < value ? low : high) = half;
    }
    return high;
  }
};

// The clearances of one ray.
class Clearances {
 public:
  void Add(const Along& over, double from, double to, double start, double length) {
    const auto share = [&](double s) { return start + s * length; };
    const double a = 2 * (over.first + over.last) - 4 * over.middle, b = over.last - over.first - a;
    const double vertex = a > 0 ? std::clamp(-b / (2 * a), from, to) : from;
    for (const double s : {from, vertex, to}) {
      const double clearance_m = over.At(s);
      if (clearance_m < min_) min_ = clearance_m, at_ = share(s);
    }
    if (over.At(from) < -dem::kSightTolerance) {
      blocked_at_ = std::min(blocked_at_, share(from));
      return;
    }
    for (const double s : {vertex, to}) {
      if (over.At(s) >= -dem::kSightTolerance) continue;
      blocked_at_ = std::min(blocked_at_, share(over.Solve(-dem::kSightTolerance, s, from)));
      return;
    }
  }
  // A part of the ray is above a hole.
  void AddGap() { has_gaps_ = true; }
  dem::SightAnswer Answer() const {
    dem::SightAnswer answer;
    answer.has_gaps = has_gaps_;
    if (std::isinf(min_)) return answer;
    answer.clearance_m = min_, answer.clearance_at = at_;
    answer.is_visible = std::isinf(blocked_at_);
    if (!answer.is_visible) answer.blocked_at = blocked_at_;
    return answer;
  }

 private:
  double min_ = std::numeric_limits<double>::infinity(), at_ = 0;
  double blocked_at_ = std::numeric_limits<double>::infinity();
  bool has_gaps_ = false;
};

// Follows rays over the meshes of tiles.
class MeshWalk {
 public:
  MeshWalk(const HasTile& has_tile, int level, const dem::SightOptions& options, const MeshOfTile& mesh_of)
      : has_tile_(has_tile), level_(level), options_(options), mesh_of_(mesh_of) {}

  Result<dem::SightAnswer> Look(const dem::SightRay& ray, const std::stop_token& stop) {
    Clearances clearances;
    const int parts = std::max(1, static_cast<int>(std::ceil(dem::LengthOf(ray) / kPartLength)));
    for (int i = 0; i < parts; ++i) {
      const Result<void> done = AddPart(ray, static_cast<double>(i) / parts, 1.0 / parts, clearances, stop);
      if (!done) return tl::unexpected(done.error());
    }
    return clearances.Answer();
  }

 private:
  Result<const DrawnMesh*> MeshAt(const dem::GeoPosition& point) {
    const geo::TileKey key = DeepestTileAt(has_tile_, point, level_);
    if (last_ != nullptr && last_->key() == key) return last_;
    auto& mesh = meshes_[key];
    if (mesh == nullptr) {
      if (meshes_.size() > kMaxDrawnTiles) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "surface: the rays cross more than {} tiles of level {}, which is the most for one request; ask "
            "for fewer rays, or for a shallower level",
            kMaxDrawnTiles, level_);
      }
      Result<std::shared_ptr<const DrawnMesh>> made = mesh_of_(key);
      if (!made) return tl::unexpected(std::move(made).error());
      mesh = *std::move(made);
    }
    return last_ = mesh.get();
  }

  // Divides a part of a ray where it leaves a bucket of a mesh.
  Result<void> AddPart(const dem::SightRay& ray, double start, double length, Clearances& clearances,
                       const std::stop_token& stop) {
    const auto at = [&](double s) { return dem::PointAt(ray, start + s * length, options_); };
    const dem::SightPoint first = at(0), last = at(1);
    const double east = std::remainder(last.longitude - first.longitude, 360), north = last.latitude - first.latitude;
    constexpr double kMinStep = 1e-6;
    for (double s = 0;;) {
      // Near a pole a part passes many buckets.
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the rays any more");
      const double inside = std::min(1.0, s + kMinStep / 2);
      const dem::GeoPosition here{std::remainder(first.longitude + inside * east, 360),
                                  first.latitude + inside * north};
      const Result<const DrawnMesh*> mesh = MeshAt(here);
      if (!mesh) return tl::unexpected(mesh.error());
      const DrawnMesh::Bucket bucket = (*mesh)->BucketAt(here);
      double next = 1;
      const auto leave = [&](double position, double low, double high, double speed) {
        if (speed == 0) return;
        next = std::min(next, inside + ((speed > 0 ? high : low) - position) / speed);
      };
      leave(here.longitude, bucket.west, bucket.east, east);
      leave(here.latitude, bucket.south, bucket.north, north);
      next = std::min(1.0, std::max(next, s + kMinStep));
      AddInBucket(**mesh, bucket, {at(s), at((s + next) / 2), at(next)}, start + s * length, (next - s) * length,
                  clearances);
      if (next >= 1) return {};
      s = next;
    }
  }

  static void AddInBucket(const DrawnMesh& mesh, const DrawnMesh::Bucket& bucket,
                          const std::array<dem::SightPoint, 3>& points, double start, double length,
                          Clearances& clearances) {
    const auto position = [&](int i) {
      const dem::SightPoint& point = points[static_cast<std::size_t>(i)];
      return dem::GeoPosition{point.longitude, point.latitude};
    };
    bool is_met = false;
    for (const std::uint32_t triangle : bucket.triangles) {
      const auto first = mesh.CrossingOf(triangle, position(0)), middle = mesh.CrossingOf(triangle, position(1)),
                 last = mesh.CrossingOf(triangle, position(2));
      if (!first || !middle || !last) continue;
      double from = 0, to = 1;
      for (std::size_t k = 0; k < 3; ++k) {
        const Along inside{first->inside[k], middle->inside[k], last->inside[k]};
        if (inside.At(from) < 0 && inside.At(to) < 0) from = 2;
        if (from > to) break;
        if (inside.At(from) < 0) {
          from = inside.Solve(0, from, to);
        } else if (inside.At(to) < 0) {
          to = inside.Solve(0, to, from);
        }
      }
      if (from > to) continue;
      is_met |= from <= 0.5 && to >= 0.5;
      if (mesh.IsInHole(triangle)) {
        clearances.AddGap();
        continue;
      }
      const Along over{points[0].height_m - first->height_m, points[1].height_m - middle->height_m,
                       points[2].height_m - last->height_m};
      clearances.Add(over, from, to, start, length);
    }
    if (is_met) return;
    // Beside the tile's edge, within the distance of a chord from its parallel.
    const double clearance_m = points[1].height_m - mesh.Nearest(position(1)).height_m;
    if (std::isnan(clearance_m)) return clearances.AddGap();
    clearances.Add({clearance_m, clearance_m, clearance_m}, 0, 1, start, length);
  }

  const HasTile& has_tile_;
  const int level_;
  const dem::SightOptions& options_;
  const MeshOfTile& mesh_of_;
  std::map<geo::TileKey, std::shared_ptr<const DrawnMesh>, IsTileBefore> meshes_;
  const DrawnMesh* last_ = nullptr;
};

double TotalLength(std::span<const dem::SightRay> rays) {
  double length_m = 0;
  for (const dem::SightRay& ray : rays) length_m += dem::LengthOf(ray);
  return length_m;
}

}  // namespace

Result<void> CheckSamplesAlong(const dem::DemSource& source, std::span<const dem::SightRay> rays) {
  double spacing_m = std::numeric_limits<double>::infinity();
  for (const dem::RasterInfo& raster : source.info().sources) spacing_m = std::min(spacing_m, raster.spacing_m);
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
                                                     const dem::SightOptions& options, const MeshOfTile& mesh_of,
                                                     const std::stop_token& stop) {
  MeshWalk walk(has_tile, level, options, mesh_of);
  std::vector<dem::SightAnswer> answers;
  answers.reserve(rays.size());
  for (const dem::SightRay& ray : rays) {
    const Result<dem::SightAnswer> answer = walk.Look(ray, stop);
    if (!answer) return tl::unexpected(answer.error());
    answers.push_back(*answer);
  }
  return answers;
}

}  // namespace terrace::tiler
