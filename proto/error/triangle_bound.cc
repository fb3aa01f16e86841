#include "proto/error/triangle_bound.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proto/error/triangle_bound.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::proto {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The rows of a strip of columns that may lie on the inner side of all sides.
struct Rows {
  int first, end;
};

// `last`: the last column of the strip, counted from the first one of the box like `first`. One row more on each side
// covers the rounding of the quotients; that of the sides is in their margin (TileErrorMeter::Impl::LargestNear).
HWY_INLINE Rows RowsOf(const BoxedTriangle& triangle, int first, int last) {
  float low = 0, high = static_cast<float>(triangle.rows - 1);
  for (const BoxedTriangle::Side& side : triangle.sides) {
    const float most =
        side.at + std::max(side.per_column * static_cast<float>(first), side.per_column * static_cast<float>(last));
    if (side.per_row == 0) continue;
    const float row = -most / side.per_row;
    if (side.per_row > 0) {
      low = std::max(low, row - 1);
    } else {
      high = std::min(high, row + 1);
    }
  }
  if (!(low <= high)) return {0, 0};
  return {static_cast<int>(low), static_cast<int>(high) + 1};
}

// Nodes are evaluated eight at a time, by strips of columns. Most triangles of rough ground have few rows; finding the
// ends of a strip would take longer.
float Largest(const BoxedTriangle& triangle, const float* samples, std::ptrdiff_t stride) {
  const hn::CappedTag<float, 8> d;
  using V = hn::Vec<decltype(d)>;
  constexpr int kMany = 8;
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
    const Rows rows = triangle.rows >= kMany ? RowsOf(triangle, i, i + lanes - 1) : Rows{0, triangle.rows};
    const float* row = samples + rows.first * stride + i;
    V y = hn::Set(d, static_cast<float>(rows.first));
    for (int j = rows.first; j < rows.end; ++j, row += stride) {
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
