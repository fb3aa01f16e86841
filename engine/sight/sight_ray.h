// Lines of sight: rays, and what is known of them.
#pragma once

#include <limits>
#include <optional>

namespace terrace::dem {

// A position above the ellipsoid.
struct SightPoint {
  double longitude = 0, latitude = 0;  // degrees
  double height_m = 0;
};

// Straight in space; with refraction nearly straight.
struct SightRay {
  SightPoint from, to;
};

struct SightOptions {
  // The share of the Earth's curvature that light in the air follows: 0 for straight lines, 0.13 for surveying. Finite.
  double refraction = 0;
};

struct SightAnswer {
  bool is_visible = true;  // no part of the ray is more than kSightTolerance below the surface
  // The smallest height of the ray above the surface, over the whole ray with its ends; negative if the ray passes
  // below the surface. NaN: there is no surface anywhere along the ray.
  double clearance_m = std::numeric_limits<double>::quiet_NaN();
  double clearance_at = 0;  // the place of this height, as a share of the ray's length
  // The first place where the ray is more than kSightTolerance below the surface, as a share of its length.
  std::optional<double> blocked_at;
  bool has_gaps = false;  // parts of the ray are above places without a height
};

// Metres. A ray from a point that was read from the same surface is not blocked by that point.
inline constexpr double kSightTolerance = 1e-3;
// Metres: the longest ray of ElevationModel::LookAlong, which does not check it. Points near the ground that are
// farther apart never see each other.
inline constexpr double kMaxSightLength = 3e6;

// Metres, along the chord.
double LengthOf(const SightRay& ray);
// The position at a share of the ray's length.
SightPoint PointAt(const SightRay& ray, double share, const SightOptions& options);

}  // namespace terrace::dem
