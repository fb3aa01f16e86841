#include "engine/crs/position_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/crs/position_rows.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Interpolates as many positions from `first` on as the tag has lanes.
template <class D>
HWY_INLINE void InterpolateVector(D d, const std::array<Position, kKnots>& knots,
                                  const std::array<const double*, kKnots>& weights, std::size_t first,
                                  Position* positions) {
  auto x = hn::Zero(d), y = x;
  for (std::size_t i = 0; i < std::size_t{kKnots}; ++i) {
    const auto weight = hn::LoadU(d, weights[i] + first);
    x = hn::Add(x, hn::Mul(weight, hn::Set(d, knots[i].x)));
    y = hn::Add(y, hn::Mul(weight, hn::Set(d, knots[i].y)));
  }
  hn::StoreInterleaved2(x, y, d, &positions[first].x);
}

void Interpolate(const std::array<Position, kKnots>& knots, const std::array<const double*, kKnots>& weights,
                 Position* positions, std::size_t count) {
  const hn::CappedTag<double, 8> wide;
  const std::size_t lanes = hn::Lanes(wide);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) InterpolateVector(wide, knots, weights, i, positions);
  for (; i < count; ++i) InterpolateVector(hn::CappedTag<double, 1>(), knots, weights, i, positions);
}

// Coordinates in turn, x and y, in the lanes of one vector.
PositionExtent Extent(const Position* positions, std::size_t count) {
  const hn::CappedTag<double, 8> d;
  const std::size_t lanes = hn::Lanes(d), numbers = 2 * count;
  const double* const number = &positions->x;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  auto least = hn::Set(d, kFar), most = hn::Neg(least), sum = hn::Zero(d);
  std::size_t i = 0;
  for (; lanes > 1 && i + lanes <= numbers; i += lanes) {
    const auto here = hn::LoadU(d, number + i);
    const auto is_known = hn::Eq(here, here);
    least = hn::Min(least, hn::IfThenElse(is_known, here, least));
    most = hn::Max(most, hn::IfThenElse(is_known, here, most));
    sum = hn::Add(sum, here);  // NaN if one is
  }
  PositionExtent extent;
  extent.are_all_known = hn::AllTrue(d, hn::Eq(sum, sum));
  const auto add = [&](const double* low, const double* high) {
    if (low[0] < extent.min.x) extent.min.x = low[0];
    if (low[1] < extent.min.y) extent.min.y = low[1];
    if (high[0] > extent.max.x) extent.max.x = high[0];
    if (high[1] > extent.max.y) extent.max.y = high[1];
  };
  double low[8], high[8];
  hn::StoreU(least, d, low);
  hn::StoreU(most, d, high);
  for (std::size_t lane = 0; lane + 1 < lanes; lane += 2) add(low + lane, high + lane);
  for (; i < numbers; i += 2) {
    add(number + i, number + i);
    extent.are_all_known &= number[i] == number[i] && number[i + 1] == number[i + 1];
  }
  return extent;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(Interpolate);
HWY_EXPORT(Extent);

}  // namespace

static_assert(sizeof(Position) == 2 * sizeof(double));  // x and y alternate in memory

void InterpolatePositions(const std::array<Position, kKnots>& knots, const std::array<const double*, kKnots>& weights,
                          std::span<Position> positions) {
  HWY_DYNAMIC_DISPATCH(Interpolate)(knots, weights, positions.data(), positions.size());
}

PositionExtent ExtentOf(std::span<const Position> positions) {
  return positions.empty() ? PositionExtent{} : HWY_DYNAMIC_DISPATCH(Extent)(positions.data(), positions.size());
}

}  // namespace terrace::dem
#endif
