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

// The outermost coordinates seen so far, by lane.
template <class D>
struct LaneExtent {
  D d;
  hn::Vec<D> min_x = hn::Set(d, std::numeric_limits<double>::infinity()), min_y = min_x;
  hn::Vec<D> max_x = hn::Neg(min_x), max_y = max_x;

  HWY_INLINE PositionExtent Whole() const {
    return {{hn::GetLane(hn::MinOfLanes(d, min_x)), hn::GetLane(hn::MinOfLanes(d, min_y))},
            {hn::GetLane(hn::MaxOfLanes(d, max_x)), hn::GetLane(hn::MaxOfLanes(d, max_y))}};
  }
};

// Interpolates as many positions from `first` on as the tag has lanes.
template <class D>
HWY_INLINE void InterpolateVector(D d, const std::array<Position, kKnots>& knots,
                                  const std::array<const double*, kKnots>& weights, std::size_t first,
                                  Position* positions, LaneExtent<D>& extent) {
  auto x = hn::Zero(d), y = x;
  for (std::size_t i = 0; i < std::size_t{kKnots}; ++i) {
    const auto weight = hn::LoadU(d, weights[i] + first);
    x = hn::Add(x, hn::Mul(weight, hn::Set(d, knots[i].x)));
    y = hn::Add(y, hn::Mul(weight, hn::Set(d, knots[i].y)));
  }
  hn::StoreInterleaved2(x, y, d, &positions[first].x);
  extent.min_x = hn::Min(extent.min_x, x), extent.max_x = hn::Max(extent.max_x, x);
  extent.min_y = hn::Min(extent.min_y, y), extent.max_y = hn::Max(extent.max_y, y);
}

PositionExtent Interpolate(const std::array<Position, kKnots>& knots, const std::array<const double*, kKnots>& weights,
                           Position* positions, std::size_t count) {
  const hn::CappedTag<double, 8> wide;
  const hn::CappedTag<double, 1> narrow;
  LaneExtent<hn::CappedTag<double, 8>> of_vectors{wide};
  LaneExtent<hn::CappedTag<double, 1>> of_rest{narrow};
  const std::size_t lanes = hn::Lanes(wide);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) InterpolateVector(wide, knots, weights, i, positions, of_vectors);
  for (; i < count; ++i) InterpolateVector(narrow, knots, weights, i, positions, of_rest);
  PositionExtent extent = of_vectors.Whole();
  extent.Add(of_rest.Whole());
  return extent;
}

void Mark(const Position* positions, std::size_t count, const Position& min, const Position& max,
          std::uint8_t* inside) {
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR  // converts no vectors of bytes
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<std::int32_t, decltype(d)> i32;
  const hn::Rebind<std::uint8_t, decltype(d)> u8;
  const auto min_x = hn::Set(d, min.x), min_y = hn::Set(d, min.y), max_x = hn::Set(d, max.x), max_y = hn::Set(d, max.y);
  const auto one = hn::Set(d, 1.0);
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) {
    hn::Vec<decltype(d)> x, y;
    hn::LoadInterleaved2(d, &positions[i].x, x, y);
    const auto is_inside =
        hn::And(hn::And(hn::Ge(x, min_x), hn::Le(x, max_x)), hn::And(hn::Ge(y, min_y), hn::Le(y, max_y)));
    const auto mark = hn::DemoteTo(u8, hn::DemoteTo(i32, hn::IfThenElseZero(is_inside, one)));
    hn::StoreU(hn::Or(mark, hn::LoadU(u8, inside + i)), u8, inside + i);
  }
#endif
  for (; i < count; ++i) {
    const Position& p = positions[i];
    inside[i] |= (p.x >= min.x) & (p.x <= max.x) & (p.y >= min.y) & (p.y <= max.y);
  }
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
HWY_EXPORT(Mark);

}  // namespace

static_assert(sizeof(Position) == 2 * sizeof(double));  // x and y alternate in memory

PositionExtent InterpolatePositions(const std::array<Position, kKnots>& knots,
                                    const std::array<const double*, kKnots>& weights, std::span<Position> positions) {
  return HWY_DYNAMIC_DISPATCH(Interpolate)(knots, weights, positions.data(), positions.size());
}

void MarkInside(std::span<const Position> positions, const Position& min, const Position& max,
                std::span<std::uint8_t> inside) {
  HWY_DYNAMIC_DISPATCH(Mark)(positions.data(), positions.size(), min, max, inside.data());
}

PositionExtent ExtentOf(std::span<const Position> positions) {
  return positions.empty() ? PositionExtent{} : HWY_DYNAMIC_DISPATCH(Extent)(positions.data(), positions.size());
}

}  // namespace terrace::dem
#endif
