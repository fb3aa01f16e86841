#include "engine/tin/scan/triangle_scan.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "engine/tin/scan/triangle_spans.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/scan/triangle_scan.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

#include "engine/tin/scan/block_scan-inl.h"
#include "engine/tin/scan/wide_scan-inl.h"

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

#if HWY_TARGET != HWY_SCALAR

// A sample's numerator in double, in the form of the header.
HWY_INLINE double NumeratorAt(const HeightField& field, const ExactPlane& t, int x, int y) {
  const double height = static_cast<double>(field.Row(t.py + y)[t.px + x]);
  return std::abs(t.d * (height - t.pz) - (t.a * x + t.b * y));
}

// Whether a triangle's largest numerator may be only the rounding error of a corner, which is relative to the
// magnitude.
HWY_INLINE bool MayBeACorner(float most, float magnitude, float doubt) { return !(most > 4 * doubt * magnitude); }

// The result of ScanBlock if single precision is not exact.
template <int kSide>
HWY_NOINLINE PlaneMisfit MisfitInDoubt(const HeightField& field, const Star& star, const StarPlanes& planes,
                                       std::size_t i, std::size_t first, const BlockFind& find) {
  const int west = planes.west[i], south = planes.south[i];
  const ExactPlane t = ExactPlaneOf(field, star, first + i);
  if (!(find.most < kMaxMagnitude) || MayBeACorner(find.most, planes.magnitude[i], kDoubtInBlocks)) {
    return ScanExactly(field, t);
  }
  double most = -1;
  int best = 0;
  for (std::uint64_t found = find.found; found != 0; found &= found - 1) {
    const int k = std::countr_zero(found);
    const double numerator = NumeratorAt(field, t, west + k % kSide, south + k / kSide);
    if (!(numerator > most)) continue;
    most = numerator;
    best = k;
  }
  const int row = star.y + south + best / kSide, column = star.x + west + best % kSide;
  return {most / t.d, SampleNumber(column, row)};
}

// The result of ScanBlock: usually a single sample.
template <int kSide>
HWY_INLINE PlaneMisfit MisfitOf(const HeightField& field, const Star& star, const StarPlanes& planes, std::size_t i,
                                std::size_t first, const BlockFind& find, float max_exact) {
  if (find.most < 0) return {};
  const int west = planes.west[i], south = planes.south[i];
  const std::uint32_t base = SampleNumber(star.x + west, star.y + south);
  const auto sample = [&](int k) { return base + SampleNumber(k % kSide, k / kSide); };
  const bool is_exact = find.most + planes.largest[i] < max_exact;
  if (is_exact || (find.most == 0 && planes.magnitude[i] == 0)) {
    if (find.most > 0) {
      return {static_cast<double>(find.most) / static_cast<double>(planes.d[i]), sample(std::countr_zero(find.found))};
    }
    // All samples lie on the plane, including the corners.
    const std::int32_t *dx = star.ring.dx.data() + first + i, *dy = star.ring.dy.data() + first + i;
    const auto bit = [&](int x, int y) { return std::uint64_t{1} << ((y - south) * kSide + x - west); };
    const std::uint64_t found = find.found & ~(bit(0, 0) | bit(dx[0], dy[0]) | bit(dx[1], dy[1]));
    return found == 0 ? PlaneMisfit{} : PlaneMisfit{0, sample(std::countr_zero(found))};
  }
  return MisfitInDoubt<kSide>(field, star, planes, i, first, find);
}

HWY_INLINE void SetBox(const HeightField& field, const Star& star, const StarPlanes& planes, std::size_t i,
                       std::size_t first, TriangleBox& t) {
  const std::int32_t *dx = star.ring.dx.data() + first + i, *dy = star.ring.dy.data() + first + i;
  t.px = star.x, t.py = star.y;
  t.ux = dx[0], t.uy = dy[0], t.vx = dx[1], t.vy = dy[1];
  t.west = planes.west[i], t.east = t.west + planes.width[i];
  t.south = planes.south[i], t.north = t.south + planes.height[i];
  LeaveBorderOut(field, t);
}

// The plane in single precision, from StarPlanes::Work.
HWY_INLINE SinglePlane SinglePlaneOf(const HeightField& field, const Star& star, const StarPlanes& planes,
                                     std::size_t i, std::size_t first) {
  SinglePlane t;
  SetBox(field, star, planes, i, first, t);
  t.pz = star.height;
  t.d = planes.d[i], t.a = planes.a[i], t.b = planes.b[i];
  return t;
}

// If all samples lie on the triangle's plane: the first one.
HWY_NOINLINE PlaneMisfit OnPlane(const HeightField& field, const Star& star, std::size_t i) {
  const std::uint32_t sample = FirstSample(field, star, i);
  return sample == kNoSample ? PlaneMisfit{} : PlaneMisfit{0, sample};
}

HWY_NOINLINE PlaneMisfit ScanWild(const HeightField& field, const Star& star, std::size_t i) {
  return ScanExactly(field, ExactPlaneOf(field, star, i));
}

// A larger triangle for which single precision is not exact. Usable only if no lane has two samples that may be the
// furthest.
HWY_NOINLINE PlaneMisfit ScanDoubtfully(const HeightField& field, const Star& star, const StarPlanes& planes,
                                        std::size_t i, std::size_t first, float max_exact) {
  const auto two = ScanWide<FurthestTwo>(field, SinglePlaneOf(field, star, planes, i, first));
  const float single = two.numerator();
  if (single < 0) return {};
  if (single == 0 && planes.magnitude[i] == 0) return OnPlane(field, star, first + i);
  const ExactPlane t = ExactPlaneOf(field, star, first + i);
  const float least = MinUncertain(single, planes.largest[i], planes.magnitude[i], max_exact, kDoubt);
  if (!(single < kMaxMagnitude) || MayBeACorner(single, planes.magnitude[i], kDoubt) || two.runner_up() >= least) {
    return ScanExactly(field, t);
  }
  HWY_ALIGN std::int32_t samples[hn::MaxLanes(kFloats)];
  hn::Store(two.furthest().numbers(), kInts, samples);
  double most = -1;
  std::uint32_t best = kNoSample;
  for (std::uint32_t bits = BitsOf(kFloats, hn::Ge(two.furthest().numerators(), All(kFloats, least))); bits != 0;
       bits &= bits - 1) {
    const auto sample = static_cast<std::uint32_t>(samples[std::countr_zero(bits)]);
    const SamplePosition at = PositionOf(sample);
    const double numerator = NumeratorAt(field, t, at.x - t.px, at.y - t.py);
    if (numerator < most || (numerator == most && sample > best)) continue;
    most = numerator;
    best = sample;
  }
  return {most / t.d, best};
}

// In integers.
HWY_INLINE IntegerPlane IntegerPlaneOf(const HeightField& field, const Star& star, const StarPlanes& planes,
                                       std::size_t i, std::size_t first) {
  const float* const heights = star.ring.heights.data() + first + i;
  IntegerPlane t;
  SetBox(field, star, planes, i, first, t);
  const float quantum = field.quantum(), quanta_a_metre = 1 / quantum;
  const auto quanta = [&](float height) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>((height - star.height) * quanta_a_metre));
  };
  const auto ux = static_cast<std::uint32_t>(t.ux), uy = static_cast<std::uint32_t>(t.uy);
  const auto vx = static_cast<std::uint32_t>(t.vx), vy = static_cast<std::uint32_t>(t.vy);
  const std::uint32_t uz = quanta(heights[0]), vz = quanta(heights[1]), d = ux * vy - uy * vx;
  t.z = star.height;
  t.lift = quantum * 0x1.8p23F;
  t.pz = static_cast<std::int32_t>(d * std::bit_cast<std::uint32_t>(t.lift));
  t.d = static_cast<std::int32_t>(d);
  t.a = static_cast<std::int32_t>(vy * uz - uy * vz);
  t.b = static_cast<std::int32_t>(ux * vz - vx * uz);
  return t;
}

// A larger triangle whose numerators fit into integers: exact.
HWY_NOINLINE PlaneMisfit ScanInIntegers(const HeightField& field, const Star& star, const StarPlanes& planes,
                                        std::size_t i, std::size_t first) {
  const auto furthest = ScanWide<Furthest<IntsTag>>(field, IntegerPlaneOf(field, star, planes, i, first));
  const std::int32_t numerator = furthest.numerator();
  if (numerator < 0) return {};
  if (numerator == 0) return OnPlane(field, star, first + i);
  return {static_cast<double>(numerator) * static_cast<double>(field.quantum()) / static_cast<double>(planes.d[i]),
          furthest.sample()};
}

HWY_INLINE PlaneMisfit ScanLarge(const HeightField& field, const Star& star, const StarPlanes& planes, std::size_t i,
                                 std::size_t first, float max_exact) {
  if (planes.d[i] <= field.max_integer_area()) return ScanInIntegers(field, star, planes, i, first);
  if (planes.largest[i] < max_exact) {
    const auto furthest = ScanWide<Furthest<FloatsTag>>(field, SinglePlaneOf(field, star, planes, i, first));
    const float numerator = furthest.numerator();
    if (numerator < 0) return {};
    if (numerator + planes.largest[i] < max_exact) {
      if (!(numerator > 0)) return OnPlane(field, star, first + i);
      return {static_cast<double>(numerator) / static_cast<double>(planes.d[i]), furthest.sample()};
    }
  }
  return ScanDoubtfully(field, star, planes, i, first, max_exact);
}

// Class by class, not triangle by triangle, because the class of a triangle would be mispredicted.
HWY_INLINE void ScanTogether(const HeightField& field, const Star& star, const StarPlanes& planes, std::size_t first,
                             std::uint32_t lanes, float max_exact, PlaneMisfit* misfits) {
  const auto lane = [](std::uint32_t bits) { return static_cast<std::size_t>(std::countr_zero(bits)); };
  for (std::uint32_t bits = lanes; bits != 0; bits &= bits - 1) misfits[lane(bits)] = {};
  for (std::uint32_t bits = planes.small & lanes; bits != 0; bits &= bits - 1) {
    const std::size_t i = lane(bits);
    const BlockFind find = ScanBlock<4>(field, star, planes, i, max_exact);
    misfits[i] = MisfitOf<4>(field, star, planes, i, first, find, max_exact);
  }
  for (std::uint32_t bits = planes.medium & lanes; bits != 0; bits &= bits - 1) {
    const std::size_t i = lane(bits);
    const BlockFind find = ScanBlock<kLargeSide>(field, star, planes, i, max_exact);
    misfits[i] = MisfitOf<kLargeSide>(field, star, planes, i, first, find, max_exact);
  }
  for (std::uint32_t bits = planes.large & lanes; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = ScanLarge(field, star, planes, lane(bits), first, max_exact);
  }
  for (std::uint32_t bits = planes.wild & lanes; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = ScanWild(field, star, first + lane(bits));
  }
}

#endif

}  // namespace

void ScanStar(const HeightField& field, const Star& star, PlaneMisfit* misfits) {
#if HWY_TARGET == HWY_SCALAR
  for (std::size_t i = 0; i < star.count; ++i) {
    if (!star.IsLeftOut(i)) misfits[i] = ScanExactly(field, ExactPlaneOf(field, star, i));
  }
#else
  StarPlanes planes;
  const std::size_t lanes = hn::Lanes(kFloats);
  const float max_exact = field.quantum() * 0xFFFF00;
  for (std::size_t first = 0; first < star.count; first += lanes) {
    planes.Work(field, star, first);
    const std::size_t count = std::min(lanes, star.count - first);
    const std::uint32_t left_out = first < Star::kMaxLeftOut ? star.left_out >> first : 0;
    ScanTogether(field, star, planes, first, ((1U << count) - 1) & ~left_out, max_exact, misfits + first);
  }
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {

HWY_EXPORT(ScanStar);

StarScan BestStarScan() {
  // Once, not at each call: CPUID traps on virtual machines.
  if (!hwy::GetChosenTarget().IsInitialized()) hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return HWY_DYNAMIC_DISPATCH(ScanStar);
}

}  // namespace terrace::tin
#endif
