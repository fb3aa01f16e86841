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

// The steps of some columns of nodes. x and y alternate in the lanes.
template <class D, class V = hn::Vec<D>>
struct LaneSteps {
  explicit LaneSteps(D d)
      : east(hn::Zero(d)),
        north(east),
        bend(east),
        least(hn::Set(d, std::numeric_limits<double>::infinity())),
        most(hn::Neg(least)),
        known(east) {}

  V east, north, bend, least, most;
  V known;  // becomes NaN if a position is
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE void Raise(V& largest, V value) {
  largest = hn::Max(largest, hn::Abs(value));
}

// Measures half as many columns of nodes as the tag has lanes. `number`: the first of the southern row. `stride`: in
// numbers. `is_last`: the eastern steps of these columns lead out of the box.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void MeasureColumns(D d, const double* number, std::size_t stride, int rows, bool is_last,
                               LaneSteps<D>& steps) {
  V here = hn::LoadU(d, number), south = hn::Sub(here, hn::LoadU(d, number - stride)), eastern = hn::Zero(d);
  steps.known = hn::Add(steps.known, south);
  for (int j = 0; j <= rows; ++j, number += stride) {
    const V next = hn::LoadU(d, number + stride), north = hn::Sub(next, here);
    const V east = hn::Sub(hn::LoadU(d, number + 2), here), west = hn::Sub(here, hn::LoadU(d, number - 2));
    steps.known = hn::Add(steps.known, hn::Add(north, hn::Add(east, west)));
    Raise<D>(eastern, east);
    if (j < rows) Raise<D>(steps.north, north);
    Raise<D>(steps.bend, hn::Sub(east, west));
    Raise<D>(steps.bend, hn::Sub(north, south));
    steps.least = hn::Min(steps.least, here);
    steps.most = hn::Max(steps.most, here);
    here = next;
    south = north;
  }
  if (!is_last) steps.east = hn::Max(steps.east, eastern);
}

// Precondition: the box has at least half as many columns of cells as the tag has lanes.
template <class D>
HWY_INLINE bool MeasureBox(D d, const double* numbers, std::size_t stride, std::size_t columns, int rows,
                           NodeSteps& steps, PixelBounds& at) {
  const std::size_t lanes = hn::Lanes(d), end = 2 * columns;
  LaneSteps<D> of_number[2] = {LaneSteps<D>(d), LaneSteps<D>(d)};  // the second one, of y, only if there is one lane
  const auto measure = [&](std::size_t i, bool is_last) HWY_ATTR {
    MeasureColumns(d, numbers + i, stride, rows, is_last, of_number[lanes == 1 ? i % 2 : 0]);
  };
  for (std::size_t i = 0; i + lanes <= end; i += lanes) measure(i, false);
  // Nodes may be measured twice.
  if (end % lanes != 0) measure(end - lanes, false);
  for (std::size_t i = end + 2 - std::max<std::size_t>(lanes, 2); i < end + 2; i += lanes) measure(i, true);
  for (std::size_t first = 0; first < (lanes == 1 ? 2 : 1); ++first) {
    const LaneSteps<D>& measured = of_number[first];
    if (!hn::AllTrue(d, hn::Eq(measured.known, measured.known))) return false;
    double east[8], north[8], bend[8], least[8], most[8];
    hn::StoreU(measured.east, d, east);
    hn::StoreU(measured.north, d, north);
    hn::StoreU(measured.bend, d, bend);
    hn::StoreU(measured.least, d, least);
    hn::StoreU(measured.most, d, most);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const bool is_x = (first + lane) % 2 == 0;
      const auto raise = [&](double& of_x, double& of_y, double value) {
        double& largest = is_x ? of_x : of_y;
        largest = std::max(largest, value);
      };
      raise(steps.east_x, steps.east_y, east[lane]);
      raise(steps.north_x, steps.north_y, north[lane]);
      raise(steps.bend_x, steps.bend_y, bend[lane]);
      double &low = is_x ? at.west : at.north, &high = is_x ? at.east : at.south;
      low = std::min(low, least[lane]);
      high = std::max(high, most[lane]);
    }
  }
  return true;
}

bool Measure(const double* numbers, std::size_t stride, std::size_t columns, int rows, NodeSteps& steps,
             PixelBounds& at) {
  const hn::CappedTag<double, 8> wide;
  if (2 * columns >= hn::Lanes(wide)) return MeasureBox(wide, numbers, stride, columns, rows, steps, at);
  const hn::CappedTag<double, 2> narrow;
  return MeasureBox(narrow, numbers, stride, columns, rows, steps, at);
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

bool MeasureSteps(const Position* southwest, std::size_t stride, int columns, int rows, NodeSteps& steps,
                  PixelBounds& at) {
  static_assert(sizeof(Position) == 2 * sizeof(double));
  return HWY_DYNAMIC_DISPATCH(Measure)(&southwest->x, 2 * stride, static_cast<std::size_t>(columns), rows, steps, at);
}

}  // namespace terrace::dem
#endif
