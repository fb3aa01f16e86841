#include "proto/mesh/horizon_reach.h"

#include <algorithm>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proto/mesh/horizon_reach.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::proto {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Of as many positions as the tag has lanes. Products are not fused with sums: the bits are those of scalars.
template <class D>
HWY_INLINE bool RaiseBy(D d, const geo::Vec3* positions, const geo::Vec3& ray, const geo::Vec3& radii, double max_reach,
                        double& reach) {
  using V = hn::Vec<D>;
  static_assert(sizeof(geo::Vec3) == 3 * sizeof(double));
  V x, y, z;
  hn::LoadInterleaved3(d, &positions->x, x, y, z);
  x = hn::Div(x, hn::Set(d, radii.x));
  y = hn::Div(y, hn::Set(d, radii.y));
  z = hn::Div(z, hn::Set(d, radii.z));
  const V ray_x = hn::Set(d, ray.x), ray_y = hn::Set(d, ray.y), ray_z = hn::Set(d, ray.z), one = hn::Set(d, 1.0);
  const auto dot = [](V ax, V ay, V az, V bx, V by, V bz)
                       HWY_ATTR { return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz)); };
  const auto minor = [](V a, V b, V c, V e) HWY_ATTR { return hn::Sub(hn::Mul(a, b), hn::Mul(c, e)); };
  const V length = hn::Sqrt(dot(x, y, z, x, y, z));
  const V cos_a = hn::Div(dot(x, y, z, ray_x, ray_y, ray_z), length);
  const V cross_x = minor(y, ray_z, z, ray_y), cross_y = minor(z, ray_x, x, ray_z), cross_z = minor(x, ray_y, y, ray_x);
  const V sin_a = hn::Div(hn::Sqrt(dot(cross_x, cross_y, cross_z, cross_x, cross_y, cross_z)), length);
  const V squared = hn::Max(one, hn::Mul(length, length));
  const V cos_b = hn::Div(one, hn::Sqrt(squared));
  const V sin_b = hn::Mul(hn::Sqrt(hn::Sub(squared, one)), cos_b);
  const V here = hn::Div(one, minor(cos_a, cos_b, sin_a, sin_b));
  if (!hn::AllTrue(d, hn::And(hn::Gt(here, hn::Zero(d)), hn::Le(here, hn::Set(d, max_reach))))) return false;
  reach = std::max(reach, hn::GetLane(hn::MaxOfLanes(d, here)));
  return true;
}

bool Raise(const std::vector<geo::Vec3>& positions, const geo::Vec3& ray, const geo::Vec3& radii, double max_reach,
           double& reach) {
  const hn::CappedTag<double, 8> wide;
  const hn::CappedTag<double, 1> narrow;
  const std::size_t lanes = hn::Lanes(wide);
  std::size_t i = 0;
  for (; i + lanes <= positions.size(); i += lanes) {
    if (!RaiseBy(wide, &positions[i], ray, radii, max_reach, reach)) return false;
  }
  for (; i < positions.size(); ++i) {
    if (!RaiseBy(narrow, &positions[i], ray, radii, max_reach, reach)) return false;
  }
  return true;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::proto
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::proto {
namespace {

HWY_EXPORT(Raise);

}  // namespace

bool RaiseReach(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double shrink_m, double max_reach,
                double& reach) {
  const double major = geo::kSemiMajorAxis - shrink_m;
  return HWY_DYNAMIC_DISPATCH(Raise)(positions, direction, {major, major, geo::kSemiMinorAxis - shrink_m}, max_reach,
                                     reach);
}

}  // namespace terrace::proto
#endif
