#include "engine/tin/mesh/mark_voids.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/mesh/mark_voids.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {

ValidHeights ScanHeights(float* heights, std::size_t count) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<float, 16> floats;
  const std::size_t lanes = hn::Lanes(floats);
  const float most = std::numeric_limits<float>::max();
  const auto beyond = hn::Set(floats, std::numeric_limits<float>::infinity());
  auto lowest = hn::Set(floats, most), highest = hn::Set(floats, -most);
  std::size_t voids = 0, i = 0;
  const auto visit = [&](auto height) HWY_ATTR {
    const auto is_finite = hn::Lt(hn::Abs(height), beyond);
    lowest = hn::IfThenElse(is_finite, hn::Min(lowest, height), lowest);
    highest = hn::IfThenElse(is_finite, hn::Max(highest, height), highest);
    return is_finite;
  };
  for (; i + lanes <= count; i += lanes) {
    const auto height = hn::LoadU(floats, heights + i);
    const auto is_finite = visit(height);
    if (hn::AllTrue(floats, is_finite)) continue;
    voids += lanes - hn::CountTrue(floats, is_finite);
    const auto none = hn::Set(floats, std::numeric_limits<float>::quiet_NaN());
    hn::StoreU(hn::IfThenElse(is_finite, height, none), floats, heights + i);
  }
  for (; i < count; ++i) {
    if (hn::AllTrue(floats, visit(hn::Set(floats, heights[i])))) continue;
    heights[i] = std::numeric_limits<float>::quiet_NaN();
    ++voids;
  }
  return {hn::GetLane(hn::MinOfLanes(floats, lowest)), hn::GetLane(hn::MaxOfLanes(floats, highest)), voids};
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {

HWY_EXPORT(ScanHeights);

ValidHeights MarkVoids(float* heights, std::size_t count) { return HWY_DYNAMIC_DISPATCH(ScanHeights)(heights, count); }

}  // namespace terrace::tin
#endif
