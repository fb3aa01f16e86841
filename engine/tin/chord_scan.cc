#include "engine/tin/chord_scan.h"

#include <cstdint>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/chord_scan.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {

ChordMisfit ScanChord(const Chord& chord, const BorderOptions& options) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::CappedTag<double, 8> doubles;
  const hn::Rebind<float, decltype(doubles)> floats;
  const hn::Rebind<std::int32_t, decltype(doubles)> ints;
  const auto all = [&](double value) HWY_ATTR { return hn::Set(doubles, value); };
  // Equal to std::max and std::min for NaN; the instructions of processors differ.
  const auto larger = [](auto x, auto y) HWY_ATTR { return hn::IfThenElse(hn::Lt(x, y), y, x); };
  const auto smaller = [](auto x, auto y) HWY_ATTR { return hn::IfThenElse(hn::Lt(y, x), y, x); };
  const auto a = all(chord.a), b = all(chord.b), h_a = all(chord.h_a), h_b = all(chord.h_b);
  const auto length = all(chord.b - chord.a), sagitta = all(options.sagitta_m);
  const auto padding = all(options.padding_m), weight = all(options.weight), step = all(options.step_m);
  const auto scale = all(options.scale), most_weight = all(kMaxBorderWeight);
  const auto lanes = static_cast<int>(hn::Lanes(doubles));

  const auto last = hn::Set(ints, chord.b - chord.a - 1), stride = hn::Set(ints, chord.stride);
  auto k = hn::Iota(doubles, chord.a + 1), most = hn::Zero(doubles), at = most;
  for (int first = 1; first < chord.b - chord.a; first += lanes) {
    const auto index = hn::Mul(hn::Min(hn::Iota(ints, first), last), stride);
    const auto height = hn::PromoteTo(doubles, hn::GatherIndex(floats, chord.heights, index));
    const auto done = hn::Sub(k, a), left = hn::Sub(b, k);
    const auto on_chord = hn::Div(hn::Add(hn::Mul(h_a, left), hn::Mul(h_b, done)), length);
    const auto misfit = hn::Add(hn::Abs(hn::Sub(on_chord, height)), hn::Mul(hn::Mul(sagitta, done), left));
    const auto padded = hn::Add(misfit, padding);
    const auto weighted = larger(hn::Mul(padded, weight), hn::Add(padded, step));
    const auto error = hn::Mul(scale, smaller(weighted, hn::Mul(most_weight, misfit)));
    const auto is_worse = hn::And(hn::Gt(error, most), hn::Lt(k, b));  // never at a void
    most = hn::IfThenElse(is_worse, error, most);
    at = hn::IfThenElse(is_worse, k, at);
    k = hn::Add(k, all(lanes));
  }
  const auto worst = hn::MaxOfLanes(doubles, most);
  const auto foremost = hn::IfThenElse(hn::Eq(most, worst), at, all(std::numeric_limits<double>::max()));
  return {hn::GetLane(worst), static_cast<int>(hn::GetLane(hn::MinOfLanes(doubles, foremost)))};
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {

HWY_EXPORT(ScanChord);

ChordMisfit WorstOfChord(const Chord& chord, const BorderOptions& options) {
  return HWY_DYNAMIC_DISPATCH(ScanChord)(chord, options);
}

}  // namespace terrace::tin
#endif
