// The path of a camera: poses at times.
#pragma once

#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "fly/scene/view.h"

namespace terrace::fly {

struct FlightPath {
  struct Point {
    double seconds = 0;
    Pose pose;
  };
  std::vector<Point> points;  // at least one; seconds ascend from 0. Longitudes may leave -180 to 180, but do not jump
  bool is_closed = false;     // the end is the start

  double duration_s() const { return points.back().seconds; }
  double length_m() const;

  // The pose at a time >= 0, interpolated linearly. After its end a closed path starts again; an open one is flown back
  // and forth. The longitude is -180 to 180.
  Pose PoseAt(double seconds) const;
};

struct FlightSpeed {
  double metres_per_second = 200;  // > 0
  double pitch = -20;              // degrees, for paths that state none
};

// Metres above the ellipsoid: from below the deepest ground of the Earth to beyond the geostationary orbit.
inline constexpr double kMinCameraHeight = -12'000, kMaxCameraHeight = 100'000'000;

// kInvalidArgument unless the longitude is -360 to 360, the latitude -90 to 90, and the height within these bounds. The
// message names the coordinate, not the place.
Result<void> CheckPosition(const GeodeticPoint& point);

// Whether two places are within 640 m of being antipodes: then no path between them is the shortest.
bool AreOpposite(const GeodeticPoint& from, const GeodeticPoint& to);

// The shortest path over the ground, and the heading along it. If both ends are equal, the camera stands still and
// looks north. Precondition: the ends are not opposite.
FlightPath MakeStraightPath(const GeodeticPoint& from, const GeodeticPoint& to, const FlightSpeed& speed);

inline constexpr double kMaxCircleRadius = 5'000'000;  // metres

// Around `center` at its height, clockwise from the north; the heading is along the circle. 0 < radius_m <
// kMaxCircleRadius.
FlightPath MakeCircle(const GeodeticPoint& center, double radius_m, const FlightSpeed& speed);

// Lines of "lon,lat,height", "lon,lat,height,heading,pitch" or "seconds,lon,lat,height,heading,pitch"; # begins a
// comment; or a GeoJSON document whose first LineString has three coordinates a point. Skips a byte order mark, and
// points at the place of the one before unless they have seconds. kInvalidArgument names the line, or the point of the
// LineString.
Result<FlightPath> ParsePath(std::string_view text, const FlightSpeed& speed);

}  // namespace terrace::fly
