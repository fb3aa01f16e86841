#include "proto/error/edge_bound.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proto/error/edge_bound.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::proto {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The largest sum, over the crossings, of the error there and the deviation of the surface beside it.
HWY_INLINE double LargestAt(const LatticeCrossings& edge) {
  const double first = std::floor(std::min(edge.from, edge.to)) + 1, last = std::ceil(std::max(edge.from, edge.to)) - 1;
  if (!(first <= last)) return 0;
  const hn::CappedTag<double, 4> d;
  const hn::Rebind<std::int32_t, decltype(d)> integers;
  const hn::Rebind<float, decltype(d)> floats;
  using V = hn::Vec<decltype(d)>;
  const double lanes = static_cast<double>(hn::Lanes(d));
  const V last_line = hn::Set(d, last), from = hn::Set(d, edge.from), zero = hn::Zero(d);
  const V inverse = hn::Set(d, 1 / (edge.to - edge.from)), last_cell = hn::Set(d, edge.cells - 1);
  V largest = zero;
  for (double line = first; line <= last; line += lanes) {
    // Surplus lanes repeat the last crossing.
    const V lines = hn::Min(hn::Iota(d, line), last_line);
    const V part = hn::Mul(hn::Sub(lines, from), inverse);
    const V along = hn::Add(hn::Set(d, edge.along_from), hn::Mul(part, hn::Set(d, edge.along_change)));
    const V cell = hn::Min(hn::Max(hn::Floor(along), zero), last_cell);
    const auto at = hn::DemoteTo(
        integers, hn::Add(hn::Mul(lines, hn::Set(d, edge.line_stride)), hn::Mul(cell, hn::Set(d, edge.step))));
    const auto gather = [&](const float* values) HWY_ATTR { return hn::GatherIndex(floats, values, at); };
    const V here = hn::PromoteTo(d, gather(edge.heights)), next = hn::PromoteTo(d, gather(edge.heights + edge.step));
    const V surface = hn::Add(here, hn::Mul(hn::Sub(along, cell), hn::Sub(next, here)));
    const V height = hn::Add(hn::Set(d, edge.height), hn::Mul(part, hn::Set(d, edge.rise)));
    const V twist = hn::PromoteTo(d, hn::Max(gather(edge.twists), gather(edge.twists + edge.step)));
    largest = hn::Max(largest, hn::Add(hn::Abs(hn::Sub(height, surface)), hn::Mul(twist, hn::Set(d, edge.bend))));
  }
  return hn::GetLane(hn::MaxOfLanes(d, largest));
}

// Measures a row of cells: |twist| of each, and the largest steps along its southern edge and from there to its
// northern one.
void MeasureCells(const float* south, const float* north, std::size_t cells, float* twists, float& east, float& up) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  auto widest = hn::Set(d, east), highest = hn::Set(d, up);
  for (std::size_t i = 0; i + lanes <= cells; i += lanes) {  // cells are a multiple of 32
    const auto here = hn::LoadU(d, south + i), above = hn::LoadU(d, north + i);
    const auto along = hn::Sub(hn::LoadU(d, south + i + 1), here), across = hn::Sub(above, here);
    widest = hn::Max(widest, hn::Abs(along));
    highest = hn::Max(highest, hn::Abs(across));
    hn::StoreU(hn::Abs(hn::Sub(hn::Sub(hn::LoadU(d, north + i + 1), above), along)), d, twists + i);
  }
  east = hn::GetLane(hn::MaxOfLanes(d, widest));
  up = hn::GetLane(hn::MaxOfLanes(d, highest));
}

// For each node: the largest twist of the four cells around it, two of this row and two of the row below. `twists`:
// from the cell west of the first node. `below`: of the row below; becomes that of this row.
void SpreadTwists(const float* twists, std::size_t nodes, float* below, float* out) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t i = 0; i < nodes; i += lanes) {
    const auto here = hn::Max(hn::LoadU(d, twists + i), hn::LoadU(d, twists + i + 1));
    hn::StoreU(hn::Max(here, hn::LoadU(d, below + i)), d, out + i);
    hn::StoreU(here, d, below + i);
  }
}

double LargestAtBoth(const LatticeCrossings& columns, const LatticeCrossings& rows) {
  return std::max(LargestAt(columns), LargestAt(rows));
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::proto
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::proto {
namespace {

HWY_EXPORT(LargestAtBoth);
HWY_EXPORT(MeasureCells);
HWY_EXPORT(SpreadTwists);

constexpr std::size_t kLanes = 16;  // limit of the lanes, and so of the values stored beyond the last node

}  // namespace

EdgeBound::EdgeBound(const TileSamples& samples)
    : samples_(samples), twists_(std::make_unique_for_overwrite<float[]>(samples.heights.size() + kLanes)) {
  const auto cells = static_cast<std::size_t>(samples.cells());
  std::vector<float> of_cells(cells + 2 + kLanes);  // by cell, with the one west of the first
  std::vector<float> below(of_cells.size());        // by node
  float* out = twists_.get() + cells + 4;
  for (int j = 0; j <= samples.cells(); ++j, out += cells + 3) {
    const float *const south = samples.Row(j), *const north = samples.Row(std::min(j + 1, samples.cells()));
    HWY_DYNAMIC_DISPATCH(MeasureCells)(south, north, cells, of_cells.data() + 1, steepest_east_, steepest_north_);
    steepest_north_ = std::max(steepest_north_, std::abs(north[cells] - south[cells]));
    HWY_DYNAMIC_DISPATCH(SpreadTwists)(of_cells.data(), cells + 1, below.data(), out);
  }
}

EdgeBound::End EdgeBound::EndAt(LatticePoint place, double height) const {
  const int cells = samples_.cells();
  const int i = std::clamp(static_cast<int>(place.x), 0, cells - 1),
            j = std::clamp(static_cast<int>(place.y), 0, cells - 1);
  const float *const south = samples_.Row(j) + i, *const north = samples_.Row(j + 1) + i;
  const double x = place.x - i, y = place.y - j;
  const double below = south[0] + x * (double{south[1]} - south[0]),
               above = north[0] + x * (double{north[1]} - north[0]);
  const std::ptrdiff_t at = south - samples_.heights.data();
  const std::ptrdiff_t nearest = at + (x > 0.5 ? 1 : 0) + (y > 0.5 ? cells + 3 : 0);
  return {place, height, std::abs(height - (below + y * (above - below))), twists_[static_cast<std::size_t>(nearest)]};
}

// Between two crossings the difference is a quadratic along the edge, which leaves the line between its ends by at most
// a quarter of its bend: the cell's twist, times the lengths of the piece on both axes. These are at most one step and
// the edge's slope against its longer axis. Each end of a piece counts the twists of all cells around it.
double EdgeBound::Over(const End& a, const End& b) const {
  const int cells = samples_.cells();
  const std::int32_t stride = cells + 3;
  const double dx = b.place.x - a.place.x, dy = b.place.y - a.place.y, rise = b.height - a.height;
  const double longer = std::max(std::abs(dx), std::abs(dy)), shorter = std::min(std::abs(dx), std::abs(dy));
  const double bend = longer > 0 ? shorter / longer / 4 : 0;
  const float *const heights = samples_.Row(0), *const twists = twists_.get() + stride + 1;
  const LatticeCrossings columns{a.place.x, b.place.x, a.place.y, dy, a.height, rise,
                                 bend,      heights,   twists,    1,  stride,   cells};
  const LatticeCrossings rows{a.place.y, b.place.y, a.place.x, dx,     a.height, rise,
                              bend,      heights,   twists,    stride, 1,        cells};
  const double largest = std::max(
      {a.error + a.twist * bend, b.error + b.twist * bend, HWY_DYNAMIC_DISPATCH(LargestAtBoth)(columns, rows)});
  constexpr double kRounding = 1e-9;
  return largest + kRounding * (largest + std::abs(a.height) + std::abs(b.height));
}

}  // namespace terrace::proto
#endif
