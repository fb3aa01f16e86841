#include "fly/scene/volume.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace terrace::fly {
namespace {

using geo::Cross;
using geo::Dot;
using geo::Normalized;
using geo::ToEcef;
using geo::Vec3;

constexpr double kMinThickness = 0.001;  // metres; thinner boxes have axes without a direction

Vec3 East(double longitude) {
  const double angle = geo::ToRadians(longitude);
  return {-std::sin(angle), std::cos(angle), 0};
}

// The point of the line from `origin` along `direction` on the plane through `point`; nothing behind the origin.
std::optional<Vec3> HitPlane(const Vec3& origin, const Vec3& direction, const Vec3& point, const Vec3& normal) {
  const double slope = Dot(normal, direction);
  if (std::abs(slope) < 1e-15) return std::nullopt;
  const double t = Dot(normal, point - origin) / slope;
  if (t < 0) return std::nullopt;
  return origin + direction * t;
}

struct Extent {
  double low = 0, high = 0;

  void Thicken() {
    if (high - low >= kMinThickness) return;
    low -= kMinThickness / 2;
    high += kMinThickness / 2;
  }
};

OrientedBox BoxOf(const Vec3& origin, const std::array<Vec3, 3>& axes, std::array<Extent, 3> extents) {
  OrientedBox box;
  box.center = origin;
  for (std::size_t i = 0; i < 3; ++i) {
    extents[i].Thicken();
    box.center = box.center + axes[i] * ((extents[i].low + extents[i].high) / 2);
    box.half_axes[i] = axes[i] * ((extents[i].high - extents[i].low) / 2);
  }
  return box;
}

// A box on the plane that touches the ellipsoid at the rectangle's centre. Three parallels bound it east and west: the
// northern one, the southern one, and the equator if it lies between them, else the middle one.
OrientedBox TangentBox(const Rectangle& r, double min_height_m, double max_height_m) {
  const double longitude = (r.west + r.east) / 2, latitude = (r.south + r.north) / 2;
  const double between = r.south < 0 && r.north > 0 ? 0.0 : latitude;
  const Vec3 origin = ToEcef(longitude, latitude, 0);
  const Vec3 up = geo::SurfaceNormal(longitude, latitude);
  const Vec3 east = East(longitude);
  const Vec3 north = Cross(up, east);
  const auto across = [&](double lon, double lat) { return Dot(east, ToEcef(lon, lat, max_height_m) - origin); };
  const auto along = [&](double lon, double lat) { return Dot(north, ToEcef(lon, lat, max_height_m) - origin); };
  const auto above = [&](double lon, double lat) { return Dot(up, ToEcef(lon, lat, min_height_m) - origin); };
  const double half = -std::min({across(r.west, r.north), across(r.west, between), across(r.west, r.south)});
  return BoxOf(origin, {east, north, up},
               {Extent{-half, half},
                Extent{std::min(along(r.west, r.south), along(longitude, r.south)),
                       std::max(along(r.west, r.north), along(longitude, r.north))},
                Extent{std::min(above(r.west, r.north), above(r.west, r.south)), max_height_m}});
}

// A rectangle of more than half the Earth: a box that stands on the plane of the equator.
OrientedBox WideBox(const Rectangle& r, double min_height_m, double max_height_m) {
  const double longitude = (r.west + r.east) / 2;
  const bool north_only = r.south > 0, south_only = r.north < 0;
  const double nearest = north_only ? r.south : south_only ? r.north : 0.0;
  Vec3 origin = ToEcef(longitude, nearest, max_height_m);
  origin.z = 0;
  const Vec3 out = Normalized(origin);
  const Vec3 up{0, 0, 1};
  const Vec3 across = Cross(out, up);
  const double half = std::abs(Dot(across, ToEcef(longitude + 90, nearest, max_height_m)));
  return BoxOf(origin, {across, up, out},
               {Extent{-half, half},
                Extent{ToEcef(0, r.south, north_only ? min_height_m : max_height_m).z,
                       ToEcef(0, r.north, south_only ? min_height_m : max_height_m).z},
                Extent{Dot(out, ToEcef(r.east, nearest, max_height_m) - origin), 0}});
}

double BoxDistanceSquared(const OrientedBox& box, const Vec3& position) {
  const Vec3 offset = position - box.center;
  double sum = 0;
  for (const Vec3& half_axis : box.half_axes) {
    const double half = geo::Length(half_axis);
    if (half <= 0) continue;
    const double beyond = std::abs(Dot(offset, half_axis) / half) - half;
    if (beyond > 0) sum += beyond * beyond;
  }
  return sum;
}

// Half the extent of the box along a unit normal.
double HalfExtent(const OrientedBox& box, const Vec3& normal) {
  double reach = 0;
  for (const Vec3& half_axis : box.half_axes) reach += std::abs(Dot(normal, half_axis));
  return reach;
}

// Whether the sphere meets the ray from the Earth's centre through the point on the ellipsoid below `point`.
bool SphereMeetsVertical(const Vec3& center, double radius_m, const GeodeticPoint& point) {
  const double distance = geo::Length(center);
  if (distance <= radius_m) return true;
  const Vec3 below = geo::ToEcef(point.longitude, point.latitude, 0);
  const Vec3 direction = Normalized(below);
  return geo::Length(center - direction * Dot(center, direction)) <= radius_m && Dot(center, direction) > 0;
}

}  // namespace

Rectangle RectangleOf(const geo::TileKey& key) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const double west = -180 + static_cast<double>(key.x) * side, south = -90 + static_cast<double>(key.y) * side;
  return {west, south, west + side, south + side};
}

Region::Region(const Rectangle& rectangle, double min_height_m, double max_height_m)
    : rectangle_(rectangle), min_height_m_(min_height_m), max_height_m_(max_height_m) {
  const Rectangle& r = rectangle_;
  box_ = r.east - r.west <= 180 ? TangentBox(r, min_height_m, max_height_m) : WideBox(r, min_height_m, max_height_m);
  southwest_ = ToEcef(r.west, r.south, 0);
  northeast_ = ToEcef(r.east, r.north, 0);
  const double longitude = (r.west + r.east) / 2, latitude = (r.south + r.north) / 2;
  const Vec3 west_middle = ToEcef(r.west, latitude, 0), east_middle = ToEcef(r.east, latitude, 0);
  west_normal_ = Normalized(Cross(west_middle, Vec3{0, 0, 1}));
  east_normal_ = Normalized(Cross(Vec3{0, 0, 1}, east_middle));
  const Vec3 westward = west_middle - east_middle;
  if (geo::Length(westward) < 1) return;  // a full turn has no sides
  const Vec3 direction = Normalized(westward);
  // A side that faces the equator is a parallel that lies outside of the chord of its corners: the plane passes through
  // the middle of the parallel instead.
  Vec3 south_up = geo::SurfaceNormal(r.east, r.south);
  if (r.south > 0) {
    const Vec3 middle = ToEcef(longitude, r.south, 0);
    const std::optional<Vec3> corner = HitPlane(middle, direction, southwest_, west_normal_);
    if (!corner) return;
    southwest_ = *corner;
    south_up = geo::SurfaceNormal(longitude, r.south);
  }
  Vec3 north_up = geo::SurfaceNormal(r.west, r.north);
  if (r.north < 0) {
    const Vec3 middle = ToEcef(longitude, r.north, 0);
    const std::optional<Vec3> corner = HitPlane(middle, direction * -1, northeast_, east_normal_);
    if (!corner) return;
    northeast_ = *corner;
    north_up = geo::SurfaceNormal(longitude, r.north);
  }
  south_normal_ = Normalized(Cross(south_up, westward));
  north_normal_ = Normalized(Cross(westward, north_up));
  has_sides_ = true;
}

double Region::SideDistanceSquared(const geo::Vec3& position) const {
  const Vec3 from_southwest = position - southwest_, from_northeast = position - northeast_;
  const double west = Dot(from_southwest, west_normal_), east = Dot(from_northeast, east_normal_);
  const double south = Dot(from_southwest, south_normal_), north = Dot(from_northeast, north_normal_);
  const double across = west > 0 ? west : std::max(east, 0.0);
  const double along = south > 0 ? south : std::max(north, 0.0);
  return across * across + along * along;
}

double Region::DistanceSquared(const geo::Vec3& position, const GeodeticPoint& geodetic) const {
  double sum = 0;
  if (has_sides_) {
    if (!rectangle_.Contains(geodetic.longitude, geodetic.latitude)) sum = SideDistanceSquared(position);
    const double vertical = std::max({geodetic.height_m - max_height_m_, min_height_m_ - geodetic.height_m, 0.0});
    sum += vertical * vertical;
  }
  return std::max(sum, BoxDistanceSquared(box_, position));
}

bool IsBehind(const Volume& volume, const Plane& plane) {
  const auto behind = [&plane](const Vec3& center, double reach) {
    return Dot(plane.normal, center) + plane.offset <= -reach;
  };
  if (const auto* sphere = std::get_if<Sphere>(&volume)) return behind(sphere->center, sphere->radius_m);
  const auto* region = std::get_if<Region>(&volume);
  const OrientedBox& box = region != nullptr ? region->box() : std::get<OrientedBox>(volume);
  return behind(box.center, HalfExtent(box, plane.normal));
}

double DistanceSquared(const Volume& volume, const geo::Vec3& position, const GeodeticPoint& geodetic) {
  if (const auto* region = std::get_if<Region>(&volume)) return region->DistanceSquared(position, geodetic);
  if (const auto* box = std::get_if<OrientedBox>(&volume)) return BoxDistanceSquared(*box, position);
  const auto& sphere = std::get<Sphere>(volume);
  const double distance = std::max(0.0, geo::Length(position - sphere.center) - sphere.radius_m);
  return distance * distance;
}

geo::Vec3 CenterOf(const Volume& volume) {
  if (const auto* region = std::get_if<Region>(&volume)) return region->box().center;
  if (const auto* box = std::get_if<OrientedBox>(&volume)) return box->center;
  return std::get<Sphere>(volume).center;
}

bool MeetsVertical(const Volume& volume, const GeodeticPoint& point) {
  if (const auto* region = std::get_if<Region>(&volume)) {
    return region->rectangle().Contains(point.longitude, point.latitude);
  }
  if (const auto* sphere = std::get_if<Sphere>(&volume))
    return SphereMeetsVertical(sphere->center, sphere->radius_m, point);
  const auto& box = std::get<OrientedBox>(volume);
  double radius_squared = 0;
  for (const Vec3& half_axis : box.half_axes) radius_squared += Dot(half_axis, half_axis);
  return SphereMeetsVertical(box.center, std::sqrt(radius_squared), point);
}

}  // namespace terrace::fly
