#include "engine/bound/column_differences.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/bound/column_differences.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Measures columns `c` and beyond, as many as the tag has lanes. `kEast`: the number of columns to the east, up to 2.
template <int kEast, class D>
HWY_INLINE void MeasureColumns(D d, const float* samples, std::size_t stride, std::size_t rows, std::size_t c,
                               ColumnDifferences& differences) {
  using V = hn::Vec<D>;
  const auto raise = [&](V& largest, V value) HWY_ATTR {
    const V size = hn::Abs(value);
    largest = hn::IfThenElse(hn::Gt(size, largest), size, largest);
  };
  V x = hn::Zero(d), y = x, xx = x, yy = x, xy = x, sum = x, north = x;
  V here = hn::LoadU(d, samples + c);
  for (std::size_t row = 0; row < rows; ++row) {
    const float* const at = samples + row * stride + c;
    sum = hn::Add(sum, here);
    V east = here, difference = here;
    if constexpr (kEast > 0) {
      east = hn::LoadU(d, at + 1);
      difference = hn::Sub(east, here);
      raise(x, difference);
    }
    if constexpr (kEast > 1) raise(xx, hn::Sub(hn::Sub(hn::LoadU(d, at + 2), east), difference));
    if (row + 1 == rows) break;
    const V below = hn::LoadU(d, at + stride), south = hn::Sub(below, here);
    raise(y, south);
    if constexpr (kEast > 0) raise(xy, hn::Sub(difference, hn::Sub(hn::LoadU(d, at + stride + 1), below)));
    if (row > 0) raise(yy, hn::Sub(south, north));
    here = below;
    north = south;
  }
  hn::StoreU(x, d, &differences.x[c]);
  hn::StoreU(y, d, &differences.y[c]);
  hn::StoreU(xx, d, &differences.xx[c]);
  hn::StoreU(yy, d, &differences.yy[c]);
  hn::StoreU(xy, d, &differences.xy[c]);
  hn::StoreU(sum, d, &differences.sum[c]);
}

// Measures all columns but the last two; returns false if they are fewer than the tag has lanes.
template <class D>
HWY_INLINE bool MeasureInner(D d, const float* samples, std::size_t stride, std::size_t rows,
                             ColumnDifferences& differences) {
  const std::size_t lanes = hn::Lanes(d), inner = differences.columns() < 2 ? 0 : differences.columns() - 2;
  if (inner < lanes) return inner == 0;
  for (std::size_t c = 0; c + lanes <= inner; c += lanes) MeasureColumns<2>(d, samples, stride, rows, c, differences);
  // Columns may be measured twice.
  if (inner % lanes != 0) MeasureColumns<2>(d, samples, stride, rows, inner - lanes, differences);
  return true;
}

void Measure(const float* samples, std::size_t stride, std::size_t rows, ColumnDifferences& differences) {
  const hn::CappedTag<float, 16> wide;
  const hn::CappedTag<float, 4> narrow;
  const hn::CappedTag<float, 1> single;
  if (!MeasureInner(wide, samples, stride, rows, differences) &&
      !MeasureInner(narrow, samples, stride, rows, differences)) {
    MeasureInner(single, samples, stride, rows, differences);
  }
  const std::size_t columns = differences.columns();
  if (columns > 1) MeasureColumns<1>(single, samples, stride, rows, columns - 2, differences);
  MeasureColumns<0>(single, samples, stride, rows, columns - 1, differences);
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

void ColumnDifferences::Resize(std::size_t columns) {
  for (std::vector<float>* of_column : {&x, &y, &xx, &yy, &xy, &sum}) of_column->resize(columns);
}

void MeasureDifferences(const float* samples, std::size_t stride, std::size_t rows, ColumnDifferences& differences) {
  HWY_DYNAMIC_DISPATCH(Measure)(samples, stride, rows, differences);
}

}  // namespace terrace::dem
#endif
