#include "fly/select/coverage.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace terrace::fly {
namespace {

constexpr int kColumns = 23, kRows = 13;

struct Surface {
  double equatorial, polar;  // semi-axes, metres
};

Surface Raised(double height_m) { return {geo::kSemiMajorAxis + height_m, geo::kSemiMinorAxis + height_m}; }

std::optional<double> HitDistance(const geo::Vec3& origin, const geo::Vec3& ray, const Surface& surface) {
  const auto scaled = [&surface](const geo::Vec3& v) {
    return geo::Vec3{v.x / surface.equatorial, v.y / surface.equatorial, v.z / surface.polar};
  };
  const geo::Vec3 o = scaled(origin), d = scaled(ray);
  const double a = geo::Dot(d, d), b = geo::Dot(o, d), c = geo::Dot(o, o) - 1;
  const double discriminant = b * b - a * c;
  if (c <= 0 || discriminant < 0 || b >= 0) return std::nullopt;
  return (-b - std::sqrt(discriminant)) / a;
}

GeodeticPoint PointOn(const geo::Vec3& p, const Surface& surface, double height_m) {
  const double across = std::hypot(p.x, p.y) / (surface.equatorial * surface.equatorial);
  return {geo::ToDegrees(std::atan2(p.y, p.x)),
          geo::ToDegrees(std::atan2(p.z / (surface.polar * surface.polar), across)), height_m};
}

const Tile* ChildAt(const Tile& tile, const GeodeticPoint& point) {
  for (const auto& child : tile.children) {
    const auto* region = std::get_if<Region>(&child->volume);
    if (region != nullptr && region->rectangle().Contains(point.longitude, point.latitude)) return child.get();
    // Other volumes do not state a rectangle; those of their descendants may.
    if (region == nullptr && ChildAt(*child, point) != nullptr) return child.get();
  }
  return nullptr;
}

struct Found {
  const Tile* deepest = nullptr;                   // with a region
  double min_height_m = -1e9, max_height_m = 1e9;  // that the regions of all tiles here share
  int drawn = 0, ready = 0;                        // with a mesh
  bool is_empty = false;                           // a tile without one is drawn
};

Found FindAt(const Tile& root, const GeodeticPoint& point, std::uint64_t frame) {
  Found found;
  for (const Tile* tile = &root; tile != nullptr; tile = ChildAt(*tile, point)) {
    if (const auto* region = std::get_if<Region>(&tile->volume)) {
      found.deepest = tile;
      found.min_height_m = std::max(found.min_height_m, region->min_height_m());
      found.max_height_m = std::min(found.max_height_m, region->max_height_m());
    }
    if (tile->visits[0].frame != frame || tile->visits[0].verdict != Verdict::kRendered) continue;
    if (!tile->HasMesh()) {
      found.is_empty = true;
      continue;
    }
    ++found.drawn;
    if (tile->state == LoadState::kReady) ++found.ready;
  }
  return found;
}

// The tiles at the point where a ray meets the lowest surface; nothing if the ray does not count.
std::optional<Found> FindOnRay(const View& view, const geo::Vec3& ray, std::uint64_t frame, const Tile& root) {
  Found found;
  double height_m = 0, next_height_m = 0;
  std::optional<double> distance;
  // Two passes: the point at height 0 finds the tile, and the tile's lowest height gives the final point.
  for (int pass = 0; pass < 2; ++pass) {
    height_m = next_height_m;
    const Surface surface = Raised(height_m);
    distance = HitDistance(view.position(), ray, surface);
    if (!distance) return std::nullopt;
    found = FindAt(root, PointOn(view.position() + ray * *distance, surface, height_m), frame);
    if (found.deepest == nullptr) return std::nullopt;
    next_height_m = found.min_height_m;
  }
  if (IsHiddenByFog(*distance, FogDensity(view.geodetic().height_m))) return std::nullopt;
  if (found.drawn > 0) return found;
  if (found.is_empty) return std::nullopt;
  // A coarse mesh may have a smaller range of heights than its descendants. Outside of it culling may be right.
  if (height_m < found.min_height_m || height_m > found.max_height_m) return std::nullopt;
  // The tile has children, but none here: the data end.
  if (!found.deepest->children.empty()) return std::nullopt;
  return found;
}

}  // namespace

Coverage MeasureCoverage(const View& view, std::uint64_t frame, const Tile& root) {
  Coverage coverage;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const geo::Vec3 ray = view.RayThrough((column + 0.5) * 2 / kColumns - 1, (row + 0.5) * 2 / kRows - 1);
      const std::optional<Found> found = FindOnRay(view, ray, frame, root);
      if (!found) continue;
      ++coverage.rays;
      if (found->drawn == 0) ++coverage.uncovered;
      if (found->drawn > 0 && found->ready == 0) ++coverage.missing;
      if (found->drawn > 1) ++coverage.doubled;
    }
  }
  return coverage;
}

}  // namespace terrace::fly
