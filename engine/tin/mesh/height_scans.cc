#include "engine/tin/mesh/height_scans.h"

#include <array>
#include <cstdint>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/mesh/height_scans.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

ValidHeights ScanHeights(float* heights, std::size_t count) {
  const hn::CappedTag<float, 16> floats;
  const std::size_t lanes = hn::Lanes(floats);
  const float most = std::numeric_limits<float>::max();
  const auto beyond = hn::Set(floats, std::numeric_limits<float>::infinity());
  auto lowest = hn::Set(floats, most), highest = hn::Set(floats, -most);
  std::size_t voids = 0, i = 0;
  const auto visit = [&](auto height) HWY_ATTR {
    const auto is_finite = hn::Lt(hn::Abs(height), beyond);
    lowest = hn::IfThenElse(is_finite, hn::Min(lowest, height), lowest);
    highest = hn::IfThenElse(is_finite, hn::Max(highest, height), highest);
    return is_finite;
  };
  for (; i + lanes <= count; i += lanes) {
    const auto height = hn::LoadU(floats, heights + i);
    const auto is_finite = visit(height);
    if (hn::AllTrue(floats, is_finite)) continue;
    voids += lanes - hn::CountTrue(floats, is_finite);
    const auto none = hn::Set(floats, std::numeric_limits<float>::quiet_NaN());
    hn::StoreU(hn::IfThenElse(is_finite, height, none), floats, heights + i);
  }
  for (; i < count; ++i) {
    if (hn::AllTrue(floats, visit(hn::Set(floats, heights[i])))) continue;
    heights[i] = std::numeric_limits<float>::quiet_NaN();
    ++voids;
  }
  return {hn::GetLane(hn::MinOfLanes(floats, lowest)), hn::GetLane(hn::MaxOfLanes(floats, highest)), voids};
}

// The number of leading heights that are multiples of the quantum. Voids count as multiples: NaN is the only value that
// does not equal itself. Numbers from 2^30 quanta on do not count, because their conversion to integers may be
// undefined.
std::size_t CountMultiples(const float* heights, std::size_t count, float quantum) {
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

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(ScanHeights);
HWY_EXPORT(CountMultiples);

// Whole metres, the server's rounding, and the steps of 32-bit data of low ground.
constexpr std::array<float, 3> kQuanta = {1, 0x1p-10F, 0x1p-14F};

}  // namespace

ValidHeights MarkVoids(float* heights, std::size_t count) { return HWY_DYNAMIC_DISPATCH(ScanHeights)(heights, count); }

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
