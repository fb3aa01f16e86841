#include "engine/tin/open_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/open_samples.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {

// Copies heights as long as they are multiples of the quantum; returns how many are copied. Voids count as multiples:
// of NaN alone it is not true that it equals itself. Numbers from 2^30 steps on are none: their conversion to integers
// may be undefined.
std::size_t CopyMultiples(const float* from, std::size_t count, float quantum, float* to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<float, 16> floats;
  const hn::RebindToSigned<decltype(floats)> ints;
  const std::size_t lanes = hn::Lanes(floats);
  const auto steps_a_metre = hn::Set(floats, 1 / quantum), limit = hn::Set(floats, 0x1p30F);
  const auto is_multiple = [&](auto height) HWY_ATTR {
    const auto steps = hn::Mul(height, steps_a_metre);
    const auto fits = hn::Lt(hn::Abs(steps), limit);
    const auto whole = hn::ConvertTo(floats, hn::ConvertTo(ints, hn::IfThenElseZero(fits, steps)));
    return hn::Or(hn::And(fits, hn::Eq(whole, steps)), hn::Not(hn::Eq(steps, steps)));
  };
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto heights = hn::LoadU(floats, from + i);
    if (!hn::AllTrue(floats, is_multiple(heights))) return i;
    hn::StoreU(heights, floats, to + i);
  }
  for (; i < count; ++i) {
    if (!hn::AllTrue(floats, is_multiple(hn::Set(floats, from[i])))) return i;
    to[i] = from[i];
  }
  return i;
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(CopyMultiples);

// Whole metres, the server's own rounding, and what 32-bit surveys of low ground come in.
constexpr std::array<float, 3> kQuanta = {1, 0x1p-10F, 0x1p-14F};

// Rows a page apart, as those of 1024 samples would be, put a column into one set of the first cache, which has room
// for a dozen lines: a triangle of more rows would push out its own. An odd number of cache lines spreads them. Rows of
// tiles are shorter, and better without gaps.
std::size_t StrideFor(int width) {
  constexpr std::size_t kSamplesOfLine = 16, kShortRow = 512;
  const auto samples = static_cast<std::size_t>(width);
  if (samples < kShortRow) return samples;
  return ((samples + kSamplesOfLine - 1) / kSamplesOfLine | 1) * kSamplesOfLine;
}

}  // namespace

OpenSamples::OpenSamples(const HeightField& field) : width_(field.width()), stride_(StrideFor(field.width())) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const auto width = static_cast<std::size_t>(width_), rows = static_cast<std::size_t>(field.height());
  heights_.GrowBy(stride_ * (rows + kPaddingRows) + kPadding);
  // Multiples of a quantum are multiples of all that come after it.
  const auto* quantum = kQuanta.begin();
  for (std::size_t y = 0; y < rows; ++y) {
    const float* const from = field.Row(static_cast<int>(y));
    float* const row = heights_.begin() + y * stride_;
    std::size_t copied = 0;
    while (quantum != kQuanta.end() && copied < width) {
      copied += HWY_DYNAMIC_DISPATCH(CopyMultiples)(from + copied, width - copied, *quantum, row + copied);
      if (copied < width) ++quantum;
    }
    std::copy(from + copied, from + width, row + copied);
    row[0] = none;
    std::fill(row + (y == 0 || y + 1 == rows ? 1 : width - 1), row + stride_, none);
  }
  std::fill(heights_.begin() + rows * stride_, heights_.end(), none);
  if (quantum != kQuanta.end()) quantum_ = *quantum;
}

}  // namespace terrace::tin
#endif
