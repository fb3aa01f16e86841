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

// The largest sum, over the crossings, of the error there and the deviation of the surface beside it. Floats suffice,
// because Over adds what they may be off.
float LargestAt(const EdgeCrossings& edge) {
  const hn::CappedTag<float, 8> d;
  const hn::RebindToSigned<decltype(d)> integers;
  using V = hn::Vec<decltype(d)>;
  const auto set = [d](float value) HWY_ATTR { return hn::Set(d, value); };
  const int lanes = static_cast<int>(hn::Lanes(d)), count = edge.columns + edge.rows;
  const V one = set(1), stride = set(static_cast<float>(edge.stride)), height = set(edge.height);
  const V columns = set(static_cast<float>(edge.columns)), last = set(static_cast<float>(count - 1));
  const V before_rows = set(edge.first_row - static_cast<float>(edge.columns));
  V largest = hn::Zero(d);
  for (int k = 0; k < count; k += lanes) {
    // Surplus lanes repeat the last crossing.
    const V crossing = hn::Min(hn::Iota(d, static_cast<float>(k)), last);
    const auto is_row = hn::Ge(crossing, columns);
    const auto either = [&](V of_row, V of_column) HWY_ATTR { return hn::IfThenElse(is_row, of_row, of_column); };
    const V line = hn::Add(crossing, either(before_rows, set(edge.first_column)));
    const V part = hn::Mul(hn::Sub(line, either(set(edge.y), set(edge.x))), either(set(edge.per_dy), set(edge.per_dx)));
    const V along = hn::MulAdd(part, either(set(edge.dx), set(edge.dy)), either(set(edge.x), set(edge.y)));
    const V cell = hn::Min(hn::Max(hn::Floor(along), either(set(edge.west), set(edge.south))),
                           either(set(edge.east), set(edge.north)));
    const V step = either(one, stride), of_line = hn::Mul(line, either(stride, one));
    const auto at = hn::ConvertTo(integers, hn::MulAdd(cell, step, of_line));
    const auto next = hn::Add(at, hn::ConvertTo(integers, step));
    // Both cells beside the crossing are around the nearer node.
    const auto nearer = hn::ConvertTo(integers, hn::MulAdd(hn::Round(along), step, of_line));
    const V here = hn::GatherIndex(d, edge.heights, at);
    const V rise = hn::Sub(hn::GatherIndex(d, edge.heights, next), here);
    const V surface = hn::MulAdd(hn::Sub(along, cell), rise, hn::Sub(here, height));
    const V error = hn::Abs(hn::Sub(hn::Mul(part, set(edge.rise)), surface));
    largest = hn::Max(largest, hn::MulAdd(hn::GatherIndex(d, edge.twists, nearer), set(edge.bend), error));
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

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::proto
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::proto {
namespace {

HWY_EXPORT(LargestAt);
HWY_EXPORT(MeasureCells);
HWY_EXPORT(SpreadTwists);

constexpr std::size_t kLanes = 16;  // limit of the lanes, and so of the values stored beyond the last node

// The lines strictly between two coordinates, which are not negative.
struct LinesBetween {
  LinesBetween(double from, double to) {
    const double low = std::min(from, to), high = std::max(from, to);
    const int below = static_cast<int>(high);
    first = static_cast<int>(low) + 1;
    count = std::max(below - first + (static_cast<double>(below) < high ? 1 : 0), 0);
  }
  int first, count;
};

constexpr double kRounding = 1e-9;  // of places and heights

}  // namespace

EdgeBound::EdgeBound(const LatticeView& lattice)
    : lattice_(lattice), twists_(std::make_unique_for_overwrite<float[]>(lattice.heights.size() + kLanes)) {
  const auto cells = static_cast<std::size_t>(lattice.cells());
  // By cell, with the one west of the first; by node.
  std::vector<float> of_cells(cells + 2 + kLanes), below(of_cells.size());
  float* out = twists_.get() + cells + 4;
  for (int j = 0; j <= lattice.cells(); ++j, out += cells + 3) {
    const float *const south = lattice.Row(j), *const north = lattice.Row(std::min(j + 1, lattice.cells()));
    HWY_DYNAMIC_DISPATCH(MeasureCells)(south, north, cells, of_cells.data() + 1, steepest_east_, steepest_north_);
    steepest_north_ = std::max(steepest_north_, std::abs(north[cells] - south[cells]));
    HWY_DYNAMIC_DISPATCH(SpreadTwists)(of_cells.data(), cells + 1, below.data(), out);
  }
}

EdgeBound::End EdgeBound::EndAt(LatticePoint place, double height) const {
  const int cells = lattice_.cells();
  const int i = std::clamp(static_cast<int>(place.x), 0, cells - 1),
            j = std::clamp(static_cast<int>(place.y), 0, cells - 1);
  const float *const south = lattice_.Row(j) + i, *const north = lattice_.Row(j + 1) + i;
  const double x = place.x - i, y = place.y - j;
  const double below = south[0] + x * (double{south[1]} - south[0]),
               above = north[0] + x * (double{north[1]} - north[0]);
  const std::ptrdiff_t at = south - lattice_.heights.data();
  const std::ptrdiff_t nearest = at + (x > 0.5 ? 1 : 0) + (y > 0.5 ? cells + 3 : 0);
  return {place, height, std::abs(height - (below + y * (above - below))), twists_[static_cast<std::size_t>(nearest)]};
}

// Between two crossings the difference is a quadratic along the edge, which leaves the line between its ends by at most
// a quarter of its bend: the cell's twist, times the lengths of the piece on both axes. These are at most one step and
// the edge's slope against its longer axis. Each end of a piece counts the twists of all cells around a node beside it.
double EdgeBound::Over(const End& a, const End& b) const {
  const int cells = lattice_.cells();
  const double dx = b.place.x - a.place.x, dy = b.place.y - a.place.y, rise = b.height - a.height;
  const double width = std::abs(dx), length = std::abs(dy);
  const double longer = std::max(width, length), shorter = std::min(width, length);
  const double bend = longer > 0 ? shorter / longer / 4 : 0;
  const double at_ends = std::max(a.error + a.twist * bend, b.error + b.twist * bend);
  const LinesBetween columns(a.place.x, b.place.x), rows(a.place.y, b.place.y);
  if (columns.count + rows.count == 0) return at_ends + kRounding * (at_ends + std::abs(a.height) + std::abs(b.height));

  const int i = static_cast<int>(a.place.x), j = static_cast<int>(a.place.y);
  const std::ptrdiff_t node = lattice_.Row(j) + i - lattice_.heights.data();
  const double per_dx = columns.count > 0 ? 1 / dx : 0, per_dy = rows.count > 0 ? 1 / dy : 0;
  EdgeCrossings edge;
  edge.x = static_cast<float>(a.place.x - i), edge.y = static_cast<float>(a.place.y - j);
  edge.dx = static_cast<float>(dx), edge.dy = static_cast<float>(dy);
  edge.per_dx = static_cast<float>(per_dx), edge.per_dy = static_cast<float>(per_dy);
  edge.first_column = static_cast<float>(columns.first - i), edge.first_row = static_cast<float>(rows.first - j);
  edge.columns = columns.count, edge.rows = rows.count;
  edge.west = static_cast<float>(-i), edge.south = static_cast<float>(-j);
  edge.east = static_cast<float>(cells - 1 - i), edge.north = static_cast<float>(cells - 1 - j);
  edge.height = static_cast<float>(a.height), edge.rise = static_cast<float>(rise);
  edge.bend = static_cast<float>(bend);
  edge.heights = lattice_.heights.data() + node, edge.twists = twists_.get() + node;
  edge.stride = cells + 3;
  const double largest = std::max<double>(at_ends, HWY_DYNAMIC_DISPATCH(LargestAt)(edge));
  // What 24 bits may be off: a crossing along the edge, and so along the line; the place itself; heights.
  constexpr double kOff = 0x1p-21;
  const double off = kOff * (width + length + 2), drop = std::abs(rise);
  const double of_crossing = off * std::max(std::abs(per_dx) * (length * steepest_north_ + drop),
                                            std::abs(per_dy) * (width * steepest_east_ + drop));
  return largest + of_crossing + off * (double{steepest_east_} + steepest_north_) + kOff * (largest + drop) +
         std::abs(a.height - static_cast<double>(edge.height)) + kRounding * (std::abs(a.height) + std::abs(b.height));
}

}  // namespace terrace::proto
#endif
