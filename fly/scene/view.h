// A camera above the ellipsoid: where it is, what it sees, and how large an error is on its screen.
#pragma once

#include <array>

#include "engine/geo/ellipsoid.h"
#include "fly/scene/volume.h"

namespace terrace::fly {

// Degrees and metres above the ellipsoid. Heading 0 is north, 90 east; pitch 0 is the horizon, -90 straight down.
struct Pose {
  GeodeticPoint position;
  double heading = 0;
  double pitch = 0;
};

struct Lens {
  int width_px = 1920;
  int height_px = 1080;
  double field_of_view = 60;  // degrees, across the width; 0 < field_of_view < 180
};

class View {
 public:
  View(const Pose& pose, const Lens& lens);

  const geo::Vec3& position() const { return position_; }
  const GeodeticPoint& geodetic() const { return geodetic_; }
  const geo::Vec3& direction() const { return direction_; }

  // Whether any part of the volume may be between the four sides of the frustum. There is no near or far plane.
  bool Sees(const Volume& volume) const;

  // The height in pixels of `error_m` metres at a distance of `distance_m` metres.
  double ErrorInPixels(double error_m, double distance_m) const;

  // Unit direction of the ray through the screen at (x, y), each from -1 (left, bottom) to 1.
  geo::Vec3 RayThrough(double x, double y) const;

 private:
  geo::Vec3 position_, direction_, up_, right_;
  GeodeticPoint geodetic_;
  double tangent_x_ = 0, tangent_y_ = 0;  // of half the angles of view
  double height_px_ = 0;
  std::array<Plane, 4> sides_;  // normals point inwards
};

// Density of the fog at a camera's height in metres, by cesium-native's table. Fog hides a point at a distance of d
// metres if exp(-(d * density)^2) is 0 in double precision.
double FogDensity(double height_m);
bool IsHiddenByFog(double distance_m, double density);

}  // namespace terrace::fly
