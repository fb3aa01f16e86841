#include "proto/error/triangle_bound.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proto/error/triangle_bound.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::proto {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// All nodes of the box are evaluated, eight at a time: most triangles of rough ground are narrower, and finding the
// ends of each row would take longer.
float Largest(const BoxedTriangle& triangle, const float* samples, std::ptrdiff_t stride) {
  const hn::CappedTag<float, 8> d;
  using V = hn::Vec<decltype(d)>;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto& [a, b, c] = triangle.sides;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0F), height = hn::Set(d, triangle.height);
  const V a_north = hn::Set(d, a.per_row), b_north = hn::Set(d, b.per_row), c_north = hn::Set(d, c.per_row);
  const V north = hn::Set(d, triangle.per_row);
  V largest = zero;
  for (int i = 0; i < triangle.columns; i += lanes) {
    const V x = hn::Iota(d, static_cast<float>(i));
    const V at_a = hn::MulAdd(x, hn::Set(d, a.per_column), hn::Set(d, a.at));
    const V at_b = hn::MulAdd(x, hn::Set(d, b.per_column), hn::Set(d, b.at));
    const V at_c = hn::MulAdd(x, hn::Set(d, c.per_column), hn::Set(d, c.at));
    const V east = hn::Mul(x, hn::Set(d, triangle.per_column));
    const float* row = samples + i;
    V y = zero;
    for (int j = 0; j < triangle.rows; ++j, row += stride) {
      const V inside =
          hn::Min(hn::Min(hn::MulAdd(y, a_north, at_a), hn::MulAdd(y, b_north, at_b)), hn::MulAdd(y, c_north, at_c));
      const V error = hn::Abs(hn::Sub(hn::MulAdd(y, north, east), hn::Sub(hn::LoadU(d, row), height)));
      largest = hn::Max(hn::IfThenElseZero(hn::Ge(inside, zero), error), largest);
      y = hn::Add(y, one);
    }
  }
  return hn::GetLane(hn::MaxOfLanes(d, largest));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::proto
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::proto {
namespace {

HWY_EXPORT(Largest);

}  // namespace

float LargestInTriangle(const BoxedTriangle& triangle, const float* samples, std::ptrdiff_t stride) {
  return HWY_DYNAMIC_DISPATCH(Largest)(triangle, samples, stride);
}

}  // namespace terrace::proto
#endif
