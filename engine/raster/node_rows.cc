#include "engine/raster/node_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/raster/node_rows.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Calls step(tag, i) for whole vectors of nodes. The last vector begins earlier if need be: nodes may be computed
// twice. Fewer nodes than lanes are computed one by one.
template <typename Step>
HWY_INLINE void ForVectors(std::size_t count, const Step& step) {
  const hn::CappedTag<double, 8> wide;
  const std::size_t lanes = hn::Lanes(wide);
  if (count < lanes) {
    for (std::size_t i = 0; i < count; ++i) step(hn::CappedTag<double, 1>(), i);
    return;
  }
  for (std::size_t i = 0; i + lanes <= count; i += lanes) step(wide, i);
  if (count % lanes != 0) step(wide, count - lanes);
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE V Between(D, V first, V second, V weight) {
  return hn::Add(first, hn::Mul(weight, hn::Sub(second, first)));
}

// GridAxis::Locate, away from the ends of an axis.
template <class D, class V = hn::Vec<D>>
struct Place {
  V index, weight;
  hn::Mask<D> is_known;
};
template <class D, class V = hn::Vec<D>>
HWY_INLINE Place<D> Locate(D d, V position, const GridAxis& axis, int size) {
  const V zero = hn::Zero(d), half = hn::Set(d, 0.5), per_factor = hn::Set(d, 1.0 / axis.factor());
  const auto is_there = hn::Eq(position, position);
  const V clamped = hn::Min(hn::Max(hn::IfThenElseZero(is_there, position), zero), hn::Set(d, size));
  const V place = hn::Sub(hn::Mul(clamped, per_factor), half);
  const V index = hn::Floor(place);
  const V here = hn::Mul(hn::Add(index, half), hn::Set(d, axis.factor()));
  const auto is_inner = hn::And(hn::Ge(place, zero), hn::Lt(place, hn::Set(d, static_cast<double>(axis.count() - 2))));
  return {index, hn::Mul(hn::Sub(clamped, here), per_factor), hn::And(is_inner, is_there)};
}

template <class D>
HWY_INLINE void LoadPositions(D d, const Position* nodes, hn::Vec<D>& x, hn::Vec<D>& y) {
  static_assert(sizeof(Position) == 2 * sizeof(double));
  hn::LoadInterleaved2(d, &nodes->x, x, y);
}

// Samples, as doubles, at places in the window. The places are whole numbers below 2^31.
template <class D>
HWY_INLINE hn::Vec<D> SamplesAt(D d, const float* samples, hn::Vec<D> places) {
  const hn::Rebind<std::int32_t, D> integers;
  const hn::Rebind<float, D> floats;
  return hn::PromoteTo(d, hn::GatherIndex(floats, samples, hn::DemoteTo(integers, places)));
}

void InterpolateNodes(const Position* nodes, std::size_t count, const GridAxes& axes, const float* samples,
                      const GridWindow& window, double* out) {
  ForVectors(count, [&](auto d, std::size_t i) HWY_ATTR {
    using V = hn::Vec<decltype(d)>;
    V x, y;
    LoadPositions(d, nodes + i, x, y);
    const auto column = Locate(d, x, axes.columns, axes.width), row = Locate(d, y, axes.rows, axes.height);
    const V zero = hn::Zero(d), one = hn::Set(d, 1), stride = hn::Set(d, static_cast<double>(window.columns));
    const auto inside = [&](V index, std::int64_t first, std::int64_t size) HWY_ATTR {
      const V at = hn::Sub(index, hn::Set(d, static_cast<double>(first)));
      return hn::Min(hn::Max(at, zero), hn::Set(d, static_cast<double>(size - 1)));
    };
    // Samples without a weight may lie outside.
    const auto next = [&](V weight) HWY_ATTR { return hn::IfThenElseZero(hn::Gt(weight, zero), one); };
    const V west = inside(column.index, window.column, window.columns);
    const V east = inside(hn::Add(column.index, next(column.weight)), window.column, window.columns);
    const V north = hn::Mul(inside(row.index, window.row, window.rows), stride);
    const V south = hn::Mul(inside(hn::Add(row.index, next(row.weight)), window.row, window.rows), stride);
    const auto along = [&](V of_row) HWY_ATTR {
      return Between(d, SamplesAt(d, samples, hn::Add(of_row, west)), SamplesAt(d, samples, hn::Add(of_row, east)),
                     column.weight);
    };
    const V height = Between(d, along(north), along(south), row.weight);
    const V unknown = hn::Set(d, std::numeric_limits<double>::quiet_NaN());
    hn::StoreU(hn::IfThenElse(hn::And(column.is_known, row.is_known), height, unknown), d, out + i);
  });
}

void InterpolateLine(const float* samples, const std::int32_t* west, const std::int32_t* east, const double* weights,
                     std::size_t count, double* out) {
  ForVectors(count, [&](auto d, std::size_t i) HWY_ATTR {
    const hn::Rebind<std::int32_t, decltype(d)> integers;
    const hn::Rebind<float, decltype(d)> floats;
    const auto at = [&](const std::int32_t* places) HWY_ATTR {
      return hn::PromoteTo(d, hn::GatherIndex(floats, samples, hn::LoadU(integers, places + i)));
    };
    hn::StoreU(Between(d, at(west), at(east), hn::LoadU(d, weights + i)), d, out + i);
  });
}

void InterpolateLines(const double* north, const double* south, double weight, std::size_t count, double* out) {
  ForVectors(count, [&](auto d, std::size_t i) HWY_ATTR {
    hn::StoreU(Between(d, hn::LoadU(d, north + i), hn::LoadU(d, south + i), hn::Set(d, weight)), d, out + i);
  });
}

void Round(const double* heights, const double* added, std::size_t count, float* out) {
  ForVectors(count, [&](auto d, std::size_t i) HWY_ATTR {
    const hn::Rebind<float, decltype(d)> floats;
    auto height = hn::LoadU(d, heights + i);
    if (added != nullptr) height = hn::Add(height, hn::LoadU(d, added + i));
    // Like RoundHeight. Round of Highway loses the sign of zero on some sets of instructions.
    const auto scaled = hn::Mul(height, hn::Set(d, 1024)), no_fraction = hn::Set(d, 0x1p52);
    const auto steps = hn::CopySign(hn::Sub(hn::Add(hn::Abs(scaled), no_fraction), no_fraction), scaled);
    hn::StoreU(hn::DemoteTo(floats, hn::Mul(steps, hn::Set(d, 1.0 / 1024))), floats, out + i);
  });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(InterpolateNodes);
HWY_EXPORT(InterpolateLine);
HWY_EXPORT(InterpolateLines);
HWY_EXPORT(Round);

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

NodeRows::NodeRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells,
                   std::size_t first, std::size_t end)
    : samples_(samples), window_(window), cells_(cells), first_(first), heights_(end - first, kUnknown) {
  if (!cells.is_separable()) return;
  for (const GridAxis::Location& place : cells.columns().subspan(first, end - first)) {
    // Columns of nodes that are not requested may lie outside.
    const std::int64_t last = window.columns - 1, west = std::clamp<std::int64_t>(place.index - window.column, 0, last);
    west_.push_back(static_cast<std::int32_t>(west));
    east_.push_back(static_cast<std::int32_t>(std::min(west + (place.weight > 0 ? 1 : 0), last)));
    weights_.push_back(place.weight);
  }
  for (Line& line : lines_) line.heights.resize(heights_.size());
}

const NodeRows::Line& NodeRows::LineOf(std::int64_t row) {
  Line& line = lines_[static_cast<std::size_t>(row % 2)];
  if (line.row == row) return line;
  line.row = row;
  HWY_DYNAMIC_DISPATCH(InterpolateLine)
  (samples_.data() + (row - window_.row) * window_.columns, west_.data(), east_.data(), weights_.data(),
   weights_.size(), line.heights.data());
  return line;
}

std::span<const double> NodeRows::Row(std::size_t j) {
  if (!cells_.is_separable()) {
    // Columns that wrap must be moved, and the indices have 32 bits.
    constexpr std::size_t kMaxSamples = std::size_t{1} << 31;
    if (cells_.axes().columns.wraps() || samples_.size() >= kMaxSamples) return heights_;
    HWY_DYNAMIC_DISPATCH(InterpolateNodes)
    (cells_.positions().Row(j).data() + first_, heights_.size(), cells_.axes(), samples_.data(), window_,
     heights_.data());
    return heights_;
  }
  const GridAxis::Location& place = cells_.rows()[j];
  const Line& north = LineOf(place.index);
  if (place.weight <= 0) return north.heights;
  const Line& south = LineOf(place.index + 1);
  HWY_DYNAMIC_DISPATCH(InterpolateLines)
  (north.heights.data(), south.heights.data(), place.weight, heights_.size(), heights_.data());
  return heights_;
}

void RoundHeights(std::span<const double> heights, std::span<const double> added, std::span<float> rounded) {
  HWY_DYNAMIC_DISPATCH(Round)
  (heights.data(), added.empty() ? nullptr : added.data(), heights.size(), rounded.data());
}

}  // namespace terrace::dem
#endif
