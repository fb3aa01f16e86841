#include "engine/tin/mesh/quantum.h"

#include <array>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/mesh/quantum.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {

// The number of leading heights that are multiples of the quantum. Voids count as multiples: NaN is the only value that
// does not equal itself. Numbers from 2^30 quanta on do not count, because their conversion to integers may be
// undefined.
std::size_t CountMultiples(const float* heights, std::size_t count, float quantum) {
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
    if (!hn::AllTrue(floats, is_multiple(hn::LoadU(floats, heights + i)))) break;
  }
  for (; i < count; ++i) {
    if (!hn::AllTrue(floats, is_multiple(hn::Set(floats, heights[i])))) return i;
  }
  return i;
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(CountMultiples);

// Whole metres, the server's rounding, and the steps of 32-bit data of low ground.
constexpr std::array<float, 3> kQuanta = {1, 0x1p-10F, 0x1p-14F};

}  // namespace

float QuantumOf(const float* heights, std::size_t count) {
  // Multiples of a quantum are multiples of all that come after it.
  for (const float quantum : kQuanta) {
    const std::size_t multiples = HWY_DYNAMIC_DISPATCH(CountMultiples)(heights, count, quantum);
    if (multiples == count) return quantum;
    heights += multiples;
    count -= multiples;
  }
  return 0;
}

}  // namespace terrace::tin
#endif
