#include "engine/sight/ray_course.h"

#include <cmath>

namespace terrace::dem {
namespace {

// Geodetic position of a point in space, by Bowring's method (Survey Review 23(181), 1976) in two steps: exact to a
// micrometre within thousands of kilometres of the surface.
SightPoint ToGeodetic(const geo::Vec3& p) {
  constexpr double a = geo::kSemiMajorAxis, b = geo::kSemiMinorAxis, e2 = geo::kEccentricitySquared;
  constexpr double e2_of_b = (a * a - b * b) / (b * b);
  const double from_axis = std::hypot(p.x, p.y);
  double tangent = p.z * a / (from_axis * b);  // of the reduced latitude
  double sine = 0, cosine = 1;
  for (int step = 0; step < 2; ++step) {
    const double reduced_cosine = std::isfinite(tangent) ? 1 / std::sqrt(1 + tangent * tangent) : 0;
    const double reduced_sine = std::isfinite(tangent) ? tangent * reduced_cosine : std::copysign(1.0, p.z);
    const double y = p.z + e2_of_b * b * reduced_sine * reduced_sine * reduced_sine;
    const double x = from_axis - e2 * a * reduced_cosine * reduced_cosine * reduced_cosine;
    const double length = std::hypot(x, y);
    sine = y / length, cosine = x / length;
    tangent = b * sine / (a * cosine);
  }
  return {geo::ToDegrees(std::atan2(p.y, p.x)), geo::ToDegrees(std::atan2(sine, cosine)),
          from_axis * cosine + p.z * sine - a * std::sqrt(1 - e2 * sine * sine)};
}

}  // namespace

RayCourse::RayCourse(const SightRay& ray, const SightOptions& options)
    : start_(geo::ToEcef(ray.from.longitude, ray.from.latitude, ray.from.height_m)),
      way_(geo::ToEcef(ray.to.longitude, ray.to.latitude, ray.to.height_m) - start_),
      length_m_(geo::Length(way_)) {
  if (options.refraction == 0) return;
  const SightPoint middle = ToGeodetic(start_ + way_ * 0.5);
  // The Gaussian radius of curvature.
  const double prime = geo::PrimeVerticalRadius(middle.latitude);
  const double meridian =
      prime * prime * prime * (1 - geo::kEccentricitySquared) / (geo::kSemiMajorAxis * geo::kSemiMajorAxis);
  rise_ = options.refraction * length_m_ * length_m_ / (2 * std::sqrt(prime * meridian));
}

SightPoint RayCourse::At(double share) const {
  SightPoint point = ToGeodetic(start_ + way_ * share);
  point.height_m += rise_ * share * (1 - share);
  return point;
}

SightAnswer SightSearch::Answer(bool has_gaps) const {
  SightAnswer answer;
  answer.has_gaps = has_gaps;
  if (clearance_m_ == kNone) return answer;
  answer.clearance_m = clearance_m_;
  answer.clearance_at = clearance_at_;
  answer.is_visible = blocked_at_ == kNone;
  if (!answer.is_visible) answer.blocked_at = blocked_at_;
  return answer;
}

double LengthOf(const SightRay& ray) { return RayCourse(ray, {}).length_m(); }

SightPoint PointAt(const SightRay& ray, double share, const SightOptions& options) {
  return RayCourse(ray, options).At(share);
}

}  // namespace terrace::dem
