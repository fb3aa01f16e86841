#include "proto/error/row_error.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proto/error/row_error.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::proto {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Calls step(i) for vectors of nodes. If count is no multiple of a vector, the last vector overlaps the one before it:
// some nodes are measured twice.
template <class D, typename Step>
HWY_INLINE void ForVectors(D d, std::size_t count, const Step& step) {
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i + lanes <= count; i += lanes) step(i);
  if (count % lanes != 0) step(count - lanes);
}

template <class D>
HWY_INLINE hn::Vec<D> SamplesAt(D d, const float* samples) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<float, D>(), samples));
}

template <class D>
HWY_INLINE double LinearWith(D d, const LinearRow& row, const float* samples, std::size_t count) {
  auto largest = hn::Zero(d);
  ForVectors(d, count, [&](std::size_t i) HWY_ATTR {
    const auto x = hn::Add(hn::Set(d, row.x), hn::Mul(hn::Set(d, row.unit), hn::Iota(d, static_cast<double>(i))));
    const auto height =
        hn::Add(hn::Add(hn::Set(d, row.origin), hn::Mul(hn::Set(d, row.slope), x)), hn::Set(d, row.rise));
    largest = hn::Max(largest, hn::Abs(hn::Sub(height, SamplesAt(d, samples + i))));
  });
  return hn::GetLane(hn::MaxOfLanes(d, largest));
}

double Linear(const LinearRow& row, const float* samples, std::size_t count) {
  const hn::CappedTag<double, 8> wide;
  if (count >= hn::Lanes(wide)) return LinearWith(wide, row, samples, count);
  const hn::CappedTag<double, 2> narrow;
  if (count >= hn::Lanes(narrow)) return LinearWith(narrow, row, samples, count);
  return LinearWith(hn::CappedTag<double, 1>(), row, samples, count);
}

template <class D>
HWY_INLINE double PlumbWith(D d, const PlumbRow& row, const geo::SinCos* columns, const float* samples,
                            std::size_t count, double& min_up) {
  static_assert(sizeof(geo::SinCos) == 2 * sizeof(double));
  auto largest = hn::Zero(d), lowest = hn::Set(d, std::numeric_limits<double>::infinity());
  ForVectors(d, count, [&](std::size_t i) HWY_ATTR {
    hn::Vec<D> sine, cosine;
    hn::LoadInterleaved2(d, &columns[i].sin, sine, cosine);
    const auto across = hn::Add(hn::Mul(cosine, hn::Set(d, row.x)), hn::Mul(sine, hn::Set(d, row.y)));
    const auto up = hn::Add(hn::Mul(hn::Set(d, row.cos), across), hn::Set(d, row.north));
    const auto height = hn::Div(hn::Sub(hn::Set(d, row.rest), hn::Mul(hn::Set(d, row.radius), across)), up);
    const auto error = hn::Abs(hn::Sub(height, SamplesAt(d, samples + i)));
    largest = hn::IfThenElse(hn::Gt(error, largest), error, largest);  // not where the plane is a plumb line: NaN
    lowest = hn::Min(lowest, hn::Abs(up));
  });
  min_up = hn::GetLane(hn::MinOfLanes(d, lowest));
  return hn::GetLane(hn::MaxOfLanes(d, largest));
}

double Plumb(const PlumbRow& row, const geo::SinCos* columns, const float* samples, std::size_t count, double& min_up) {
  const hn::CappedTag<double, 8> wide;
  if (count >= hn::Lanes(wide)) return PlumbWith(wide, row, columns, samples, count, min_up);
  const hn::CappedTag<double, 2> narrow;
  if (count >= hn::Lanes(narrow)) return PlumbWith(narrow, row, columns, samples, count, min_up);
  return PlumbWith(hn::CappedTag<double, 1>(), row, columns, samples, count, min_up);
}

HeightExtent Extent(const float* heights, std::size_t count) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  auto lowest = hn::Set(d, heights[0]), highest = lowest;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto here = hn::LoadU(d, heights + i);
    lowest = hn::Min(lowest, here);
    highest = hn::Max(highest, here);
  }
  HeightExtent extent{hn::GetLane(hn::MinOfLanes(d, lowest)), hn::GetLane(hn::MaxOfLanes(d, highest))};
  for (; i < count; ++i) {
    if (heights[i] < extent.lowest) extent.lowest = heights[i];
    if (heights[i] > extent.highest) extent.highest = heights[i];
  }
  return extent;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::proto
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::proto {
namespace {

HWY_EXPORT(Linear);
HWY_EXPORT(Plumb);
HWY_EXPORT(Extent);

}  // namespace

HeightExtent ExtentOf(std::span<const float> heights) {
  return HWY_DYNAMIC_DISPATCH(Extent)(heights.data(), heights.size());
}

double LargestOfLinearRow(const LinearRow& row, const float* samples, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(Linear)(row, samples, count);
}

double LargestOfPlumbRow(const PlumbRow& row, const geo::SinCos* columns, const float* samples, std::size_t count,
                         double& min_up) {
  return HWY_DYNAMIC_DISPATCH(Plumb)(row, columns, samples, count, min_up);
}

}  // namespace terrace::proto
#endif
