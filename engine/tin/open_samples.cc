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

// Voids count as multiples: of NaN alone it is not true that it equals itself. Numbers from 2^30 steps on are none:
// their conversion to integers may be undefined.
bool AreMultiples(const float* heights, std::size_t count, float quantum) {
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
    if (!hn::AllTrue(floats, is_multiple(hn::LoadU(floats, heights + i)))) return false;
  }
  for (; i < count; ++i) {
    if (!hn::AllTrue(floats, is_multiple(hn::Set(floats, heights[i])))) return false;
  }
  return true;
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(AreMultiples);

// Whole metres, the server's own rounding, and what 32-bit surveys of low ground come in.
constexpr std::array<float, 3> kQuanta = {1, 0x1p-10F, 0x1p-14F};

float QuantumOf(const HeightField& field) {
  const auto count = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  for (const float quantum : kQuanta) {
    if (HWY_DYNAMIC_DISPATCH(AreMultiples)(field.Row(0), count, quantum)) return quantum;
  }
  return 0;
}

}  // namespace

OpenSamples::OpenSamples(const HeightField& field)
    : width_(field.width()), stride_(static_cast<std::size_t>(field.width())), quantum_(QuantumOf(field)) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const auto rows = static_cast<std::size_t>(field.height());
  heights_.GrowTo(stride_ * (rows + kPaddingRows) + kPadding, none);
  for (std::size_t y = 1; y + 1 < rows; ++y) {
    const float* row = field.Row(static_cast<int>(y));
    std::copy(row + 1, row + stride_ - 1, heights_.begin() + static_cast<std::ptrdiff_t>(y * stride_ + 1));
  }
}

}  // namespace terrace::tin
#endif
