// The course of a ray through space.
#pragma once

#include "engine/geo/ellipsoid.h"
#include "engine/sight/sight_ray.h"

namespace terrace::dem {

// Where the air bends a ray, it lies above the chord by k * d * (D - d) / 2R.
class RayCourse {
 public:
  RayCourse(const SightRay& ray, const SightOptions& options);

  // The chord: ECEF metres.
  const geo::Vec3& start() const { return start_; }
  const geo::Vec3& way() const { return way_; }  // from the start to the end
  double length_m() const { return length_m_; }

  // The position at a share of the chord's length.
  SightPoint At(double share) const;

 private:
  geo::Vec3 start_, way_;
  double length_m_, rise_ = 0;
};

}  // namespace terrace::dem
