#include "engine/geo/sines.h"

#include <algorithm>
#include <array>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/geo/sines.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::geo {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr double kGrid = 17592186044416.0;  // 2^44

// The terms of a series of e^t with alternating signs, from 1 / first! on, as far as sine.cc's short ones.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V Series(D d, V square, int first) {
  constexpr int kTerms = 18;
  constexpr auto kInverse = [] {
    std::array<double, kTerms> inverses{};
    double factorial = 1;  // exact up to 18!
    for (int n = 0; n < kTerms; ++n) {
      factorial *= std::max(n, 1);
      inverses[static_cast<std::size_t>(n)] = 1 / factorial;
    }
    return inverses;
  }();
  int n = kTerms - 2 + first;
  V sum = hn::Set(d, kInverse[static_cast<std::size_t>(n)]);
  for (n -= 2; n >= first; n -= 2) sum = hn::NegMulAdd(square, sum, hn::Set(d, kInverse[static_cast<std::size_t>(n)]));
  return sum;
}

// Angles of as many lanes as the tag has, as RoundedSinCos finds them. Where double precision does not decide between
// two multiples, it is asked.
template <class D>
HWY_INLINE void Compute(D d, const double* degrees, SinCos* out) {
  using V = hn::Vec<D>;
  constexpr double kDoubt = 1.0 / 128;
  const V all = hn::LoadU(d, degrees), quarter = hn::Round(hn::Mul(all, hn::Set(d, 1.0 / 90)));
  const V angle = hn::Sub(all, hn::Mul(quarter, hn::Set(d, 90)));
  const V radians = hn::Mul(angle, hn::Set(d, 0.017453292519943295)), square = hn::Mul(radians, radians);
  const V grid = hn::Set(d, kGrid), per_grid = hn::Set(d, 1 / kGrid), clear = hn::Set(d, 0.5 - kDoubt);
  const V sine = hn::Mul(hn::Mul(Series(d, square, 1), radians), grid), cosine = hn::Mul(Series(d, square, 0), grid);
  const V near_sine = hn::Round(sine), near_cosine = hn::Round(cosine);
  const V off = hn::Max(hn::Abs(hn::Sub(sine, near_sine)), hn::Abs(hn::Sub(cosine, near_cosine)));
  constexpr std::size_t kMaxLanes = 8;
  double of_sine[kMaxLanes], of_cosine[kMaxLanes], quarters[kMaxLanes], doubts[kMaxLanes];
  hn::StoreU(hn::Mul(near_sine, per_grid), d, of_sine);
  hn::StoreU(hn::Mul(near_cosine, per_grid), d, of_cosine);
  hn::StoreU(quarter, d, quarters);
  hn::StoreU(off, d, doubts);
  const bool are_clear = hn::AllTrue(d, hn::Lt(off, clear));
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    // Added to 0 and subtracted from 0 to avoid -0.
    const double s = of_sine[lane], c = of_cosine[lane];
    switch (static_cast<long>(quarters[lane]) & 3) {
      case 0:
        out[lane] = {0 + s, c};
        break;
      case 1:
        out[lane] = {c, 0 - s};
        break;
      case 2:
        out[lane] = {0 - s, -c};
        break;
      default:
        out[lane] = {-c, 0 + s};
    }
    if (!are_clear && !(doubts[lane] < 0.5 - kDoubt)) out[lane] = RoundedSinCos(degrees[lane]);
  }
}

void ComputeAll(std::span<const double> degrees, SinCos* out) {
  const hn::CappedTag<double, 8> wide;
  const hn::CappedTag<double, 1> narrow;
  const std::size_t lanes = hn::Lanes(wide), count = degrees.size();
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) Compute(wide, &degrees[i], out + i);
  for (; i < count; ++i) Compute(narrow, &degrees[i], out + i);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::geo
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::geo {
namespace {

HWY_EXPORT(ComputeAll);

}  // namespace

std::vector<SinCos> RoundedSinCosOf(std::span<const double> degrees) {
  std::vector<SinCos> all(degrees.size());
  HWY_DYNAMIC_DISPATCH(ComputeAll)(degrees, all.data());
  return all;
}

}  // namespace terrace::geo
#endif
