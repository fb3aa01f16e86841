#include "fly/scene/view.h"

#include <algorithm>
#include <cmath>

namespace terrace::fly {
namespace {

using geo::Cross;
using geo::Dot;
using geo::Vec3;

constexpr double kMinDistance = 1e-7;  // metres; inside a volume the distance is 0

Plane SideThrough(const Vec3& position, const Vec3& normal) { return {normal, -Dot(normal, position)}; }

}  // namespace

View::View(const Pose& pose, const Lens& lens) : geodetic_(pose.position), height_px_(lens.height_px) {
  position_ = geo::ToEcef(geodetic_.longitude, geodetic_.latitude, geodetic_.height_m);
  const Vec3 sky = geo::SurfaceNormal(geodetic_.longitude, geodetic_.latitude);
  const double angle = geo::ToRadians(geodetic_.longitude);
  const Vec3 east{-std::sin(angle), std::cos(angle), 0};
  const Vec3 north = Cross(sky, east);
  const double heading = geo::ToRadians(pose.heading), pitch = geo::ToRadians(pose.pitch);
  const Vec3 ahead = east * std::sin(heading) + north * std::cos(heading);
  direction_ = ahead * std::cos(pitch) + sky * std::sin(pitch);
  up_ = sky * std::cos(pitch) - ahead * std::sin(pitch);
  right_ = Cross(direction_, up_);
  tangent_x_ = std::tan(geo::ToRadians(lens.field_of_view) / 2);
  tangent_y_ = tangent_x_ * lens.height_px / lens.width_px;
  const double across = std::atan(tangent_x_), along = std::atan(tangent_y_);
  const Vec3 inwards_x = direction_ * std::sin(across), inwards_y = direction_ * std::sin(along);
  sides_ = {SideThrough(position_, inwards_x + right_ * std::cos(across)),
            SideThrough(position_, inwards_x - right_ * std::cos(across)),
            SideThrough(position_, inwards_y + up_ * std::cos(along)),
            SideThrough(position_, inwards_y - up_ * std::cos(along))};
}

bool View::Sees(const Volume& volume) const {
  return std::none_of(sides_.begin(), sides_.end(), [&](const Plane& side) { return IsBehind(volume, side); });
}

double View::ErrorInPixels(double error_m, double distance_m) const {
  return error_m / (tangent_y_ * std::max(distance_m, kMinDistance)) * height_px_ / 2;
}

geo::Vec3 View::RayThrough(double x, double y) const {
  return geo::Normalized(direction_ + right_ * (tangent_x_ * x) + up_ * (tangent_y_ * y));
}

double FogDensity(double height_m) {
  struct Row {
    double height_m, density;
  };
  static constexpr std::array<Row, 21> kTable = {{
      {359.393, 2.0e-5},     {800.749, 2.0e-4},     {1275.6501, 1.0e-4},   {2151.1192, 7.0e-5},   {3141.7763, 5.0e-5},
      {4777.5198, 4.0e-5},   {6281.2493, 3.0e-5},   {12364.307, 1.9e-5},   {15900.765, 1.0e-5},   {49889.0549, 8.5e-6},
      {78026.8259, 6.2e-6},  {99260.7344, 5.8e-6},  {120036.3873, 5.3e-6}, {151011.0158, 5.2e-6}, {156091.1953, 5.1e-6},
      {203849.3112, 4.2e-6}, {274866.9803, 4.0e-6}, {319916.3149, 3.4e-6}, {493552.0528, 2.6e-6}, {628733.5874, 2.2e-6},
      {1000000.0, 0.0},
  }};
  const auto* above =
      std::find_if(kTable.begin(), kTable.end(), [height_m](const Row& row) { return row.height_m >= height_m; });
  if (above == kTable.begin()) return kTable.front().density;
  if (above == kTable.end()) return kTable.back().density;
  const Row& low = *(above - 1);
  const double fraction = (height_m - low.height_m) / (above->height_m - low.height_m);
  return low.density + (above->density - low.density) * fraction;
}

bool IsHiddenByFog(double distance_m, double density) {
  if (density <= 0) return false;
  const double depth = distance_m * density;
  return std::exp(-depth * depth) <= 0;
}

}  // namespace terrace::fly
