// Bounding volumes of tiles, as 3D Tiles defines them, and their tests for selection. Positions are ECEF metres, angles
// are degrees.
#pragma once

#include <array>
#include <variant>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"

namespace terrace::fly {

// Dot(normal, p) + offset is the signed distance in metres, positive on the side that the unit normal points to.
struct Plane {
  geo::Vec3 normal;
  double offset = 0;
};

struct Rectangle {  // degrees; west <= east, so across the antimeridian east is above 180
  double west = 0, south = 0, east = 0, north = 0;

  // -180 <= longitude <= 180
  bool Contains(double longitude, double latitude) const {
    return latitude >= south && latitude <= north &&
           ((longitude >= west && longitude <= east) || (longitude + 360 >= west && longitude + 360 <= east));
  }
};

Rectangle RectangleOf(const geo::TileKey& key);

struct GeodeticPoint {
  double longitude = 0, latitude = 0, height_m = 0;
};

struct Sphere {
  geo::Vec3 center;
  double radius_m = 0;
};

struct OrientedBox {
  geo::Vec3 center;
  std::array<geo::Vec3, 3> half_axes;  // orthogonal
};

// The points above a rectangle between two heights over the ellipsoid. As in cesium-native, a box around it is tested
// against the frustum. Its distance is the larger one of the distances to that box and to the planes of its sides.
class Region {
 public:
  Region() = default;
  Region(const Rectangle& rectangle, double min_height_m, double max_height_m);

  const Rectangle& rectangle() const { return rectangle_; }
  double min_height_m() const { return min_height_m_; }
  double max_height_m() const { return max_height_m_; }
  const OrientedBox& box() const { return box_; }

  double DistanceSquared(const geo::Vec3& position, const GeodeticPoint& geodetic) const;

 private:
  double SideDistanceSquared(const geo::Vec3& position) const;

  Rectangle rectangle_;
  double min_height_m_ = 0, max_height_m_ = 0;
  OrientedBox box_;
  bool has_sides_ = false;
  geo::Vec3 southwest_, northeast_;
  geo::Vec3 west_normal_, south_normal_, east_normal_, north_normal_;
};

using Volume = std::variant<Region, Sphere, OrientedBox>;

// Whether the volume lies wholly behind the plane.
bool IsBehind(const Volume& volume, const Plane& plane);

// Square of the distance in metres; 0 inside. `geodetic` is the same point as `position`.
double DistanceSquared(const Volume& volume, const geo::Vec3& position, const GeodeticPoint& geodetic);

geo::Vec3 CenterOf(const Volume& volume);

// Whether the volume is above, at or below the point. For a region: its rectangle contains the point. For a
// sphere: it contains the Earth's centre, or meets the half-line from there through the point's projection onto the
// ellipsoid. A box is tested as its bounding sphere.
bool MeetsVertical(const Volume& volume, const GeodeticPoint& point);

}  // namespace terrace::fly
