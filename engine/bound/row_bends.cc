#include "engine/bound/row_bends.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/bound/row_bends.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Columns `c` and beyond, as many as the tag has lanes.
template <class D>
HWY_INLINE void AddColumns(D d, const float* above, const float* here, const float* below, std::size_t c,
                           ColumnBends& bends) {
  using V = hn::Vec<D>;
  const auto raise = [&](std::vector<float>& largest, V value) HWY_ATTR {
    const V size = hn::Abs(value), known = hn::LoadU(d, &largest[c]);
    hn::StoreU(hn::IfThenElse(hn::Gt(size, known), size, known), d, &largest[c]);
  };
  const V first = hn::LoadU(d, here + c), second = hn::LoadU(d, here + c + 1), third = hn::LoadU(d, here + c + 2);
  const V x = hn::Sub(second, first);
  hn::StoreU(hn::Add(hn::LoadU(d, &bends.sum[c]), first), d, &bends.sum[c]);
  raise(bends.x, x);
  raise(bends.xx, hn::Sub(hn::Sub(third, second), x));
  if (below == nullptr) return;
  const V south = hn::LoadU(d, below + c), y = hn::Sub(south, first);
  raise(bends.y, y);
  raise(bends.xy, hn::Sub(x, hn::Sub(hn::LoadU(d, below + c + 1), south)));
  if (above != nullptr) raise(bends.yy, hn::Sub(y, hn::Sub(first, hn::LoadU(d, above + c))));
}

void Add(const float* above, const float* here, const float* below, ColumnBends& bends) {
  const hn::CappedTag<float, 16> wide;
  const hn::CappedTag<float, 1> narrow;
  const std::size_t lanes = hn::Lanes(wide), columns = bends.sum.size();
  std::size_t c = 0;
  for (; c + lanes + 2 <= columns; c += lanes) AddColumns(wide, above, here, below, c, bends);
  for (; c + 3 <= columns; ++c) AddColumns(narrow, above, here, below, c, bends);
  const auto raise = [](float& largest, float value) {
    const float size = value < 0 ? -value : value;
    largest = size > largest ? size : largest;
  };
  for (; c < columns; ++c) {  // the last columns have fewer neighbours
    bends.sum[c] += here[c];
    const bool has_next = c + 1 < columns;
    if (has_next) raise(bends.x[c], here[c + 1] - here[c]);
    if (below == nullptr) continue;
    raise(bends.y[c], below[c] - here[c]);
    if (has_next) raise(bends.xy[c], here[c + 1] - here[c] - (below[c + 1] - below[c]));
    if (above != nullptr) raise(bends.yy[c], below[c] - here[c] - (here[c] - above[c]));
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(Add);

}  // namespace

void ColumnBends::Reset(std::size_t columns) {
  for (std::vector<float>* of_column : {&x, &y, &xx, &yy, &xy, &sum}) of_column->assign(columns, 0);
}

void AddRow(const float* above, const float* here, const float* below, ColumnBends& bends) {
  HWY_DYNAMIC_DISPATCH(Add)(above, here, below, bends);
}

}  // namespace terrace::dem
#endif
