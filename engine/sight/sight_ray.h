// Lines of sight: rays, and what is known of them.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

namespace terrace::dem {

// A position above the ellipsoid.
struct SightPoint {
  double longitude = 0, latitude = 0;  // degrees
  double height_m = 0;
};

// A straight line in space, or nearly straight where the air bends it.
struct SightRay {
  SightPoint from, to;
};

struct SightOptions {
  // The share of the Earth's curvature that light in the air follows: 0 for straight lines, 0.13 for surveying. Finite.
  double refraction = 0;
};

struct SightAnswer {
  bool is_visible = true;  // no part of the ray is more than kSightTolerance below the surface
  // The smallest vertical distance from the surface up to the ray, its ends included; negative if the ray passes below.
  // NaN: there is no surface anywhere along the ray.
  double clearance_m = std::numeric_limits<double>::quiet_NaN();
  double clearance_at = 0;  // as a share of the ray's length
  // The first place more than kSightTolerance below the surface, as a share of the ray's length.
  std::optional<double> blocked_at;
  bool has_gaps = false;  // parts of the ray are above places without a height
};

// Metres. A ray that touches the ground, as from a point that was read from the same surface, is not blocked.
inline constexpr double kSightTolerance = 1e-3;
// Metres. The longest ray that ElevationModel::LookAlong accepts: a precondition, which is not checked. Points near the
// ground that are farther apart never see each other.
inline constexpr double kMaxSightLength = 3e6;

// What is known of a ray so far. Used by this library only.
class SightSearch {
 public:
  // Whether a part of the ray that begins at `start` and has at least this clearance can be skipped.
  bool IsSettled(double clearance_m, double start) const {
    return clearance_m >= clearance_m_ && (clearance_m >= -kSightTolerance || start >= blocked_at_);
  }
  // A clearance of the ray at a share of its length.
  void Add(double clearance_m, double at) {
    if (clearance_m < clearance_m_) clearance_m_ = clearance_m, clearance_at_ = at;
  }
  void AddBlocked(double at) { blocked_at_ = std::min(blocked_at_, at); }
  bool IsBlockedBefore(double at) const { return blocked_at_ <= at; }
  SightAnswer Answer(bool has_gaps) const;

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double clearance_m_ = kNone, clearance_at_ = 0, blocked_at_ = kNone;
};

// Metres, along the chord.
double LengthOf(const SightRay& ray);
// The position at a share of the ray's length.
SightPoint PointAt(const SightRay& ray, double share, const SightOptions& options);

}  // namespace terrace::dem
