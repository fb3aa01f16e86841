#include "engine/bound/node_steps.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/bound/node_steps.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The steps of one axis and a vector of columns.
template <class D, class V = hn::Vec<D>>
struct AxisSteps {
  explicit AxisSteps(D d)
      : east(hn::Zero(d)),
        north(east),
        bend(east),
        least(hn::Set(d, std::numeric_limits<double>::infinity())),
        most(hn::Neg(least)) {}

  V east, north, bend, least, most;
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE void Raise(V& largest, V value) {
  largest = hn::Max(largest, hn::Abs(value));
}

// Measures the nodes of as many columns as the tag has lanes. `known` becomes NaN if a place is.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void MeasureColumns(D d, const double* place, std::size_t stride, int rows, AxisSteps<D>& steps, V& known) {
  V here = hn::LoadU(d, place), south = hn::Sub(here, hn::LoadU(d, place - stride));
  known = hn::Add(known, south);
  for (int j = 0; j <= rows; ++j, place += stride) {
    const V next = hn::LoadU(d, place + stride), north = hn::Sub(next, here);
    const V east = hn::Sub(hn::LoadU(d, place + 1), here), west = hn::Sub(here, hn::LoadU(d, place - 1));
    known = hn::Add(known, hn::Add(north, hn::Add(east, west)));
    Raise<D>(steps.east, east);
    if (j < rows) Raise<D>(steps.north, north);
    Raise<D>(steps.bend, hn::Sub(east, west));
    Raise<D>(steps.bend, hn::Sub(north, south));
    steps.least = hn::Min(steps.least, here);
    steps.most = hn::Max(steps.most, here);
    here = next;
    south = north;
  }
}

// `is_last`: the eastern steps of these columns lead out of the box.
template <class D>
HWY_INLINE bool MeasureVector(D d, const NodeCoordinates& places, std::size_t column, int rows, bool is_last,
                              NodeSteps& steps, PixelBounds& at) {
  AxisSteps<D> x(d), y(d);
  auto known = hn::Zero(d);
  MeasureColumns(d, places.x + column, places.stride, rows, x, known);
  MeasureColumns(d, places.y + column, places.stride, rows, y, known);
  if (!hn::AllTrue(d, hn::Eq(known, known))) return false;
  const auto largest = [&](auto value) HWY_ATTR { return hn::GetLane(hn::MaxOfLanes(d, value)); };
  const auto least = [&](auto value) HWY_ATTR { return hn::GetLane(hn::MinOfLanes(d, value)); };
  if (!is_last) {
    steps.east_x = std::max(steps.east_x, largest(x.east));
    steps.east_y = std::max(steps.east_y, largest(y.east));
  }
  steps.north_x = std::max(steps.north_x, largest(x.north));
  steps.north_y = std::max(steps.north_y, largest(y.north));
  steps.bend_x = std::max(steps.bend_x, largest(x.bend));
  steps.bend_y = std::max(steps.bend_y, largest(y.bend));
  at.Add(least(x.least), least(y.least));
  at.Add(largest(x.most), largest(y.most));
  return true;
}

template <class D>
HWY_INLINE bool MeasureBox(D d, const NodeCoordinates& places, std::size_t columns, int rows, NodeSteps& steps,
                           PixelBounds& at) {
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i + lanes <= columns; i += lanes) {
    if (!MeasureVector(d, places, i, rows, false, steps, at)) return false;
  }
  // Nodes may be measured twice.
  if (columns % lanes != 0 && !MeasureVector(d, places, columns - lanes, rows, false, steps, at)) return false;
  return MeasureVector(d, places, columns + 1 - lanes, rows, true, steps, at);
}

bool Measure(const NodeCoordinates& places, std::size_t columns, int rows, NodeSteps& steps, PixelBounds& at) {
  const hn::CappedTag<double, 8> wide;
  if (columns >= hn::Lanes(wide)) return MeasureBox(wide, places, columns, rows, steps, at);
  const hn::CappedTag<double, 2> narrow;
  if (columns >= hn::Lanes(narrow)) return MeasureBox(narrow, places, columns, rows, steps, at);
  return MeasureBox(hn::CappedTag<double, 1>(), places, columns, rows, steps, at);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(Measure);

}  // namespace

bool MeasureSteps(const NodeCoordinates& places, int columns, int rows, NodeSteps& steps, PixelBounds& at) {
  return HWY_DYNAMIC_DISPATCH(Measure)(places, static_cast<std::size_t>(columns), rows, steps, at);
}

}  // namespace terrace::dem
#endif
