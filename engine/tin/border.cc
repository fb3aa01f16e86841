#include "engine/tin/border.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/border.cc"
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
  const auto scale = all(options.scale), max_weight = all(kMaxBorderWeight);
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
    const auto error = hn::Mul(scale, smaller(weighted, hn::Mul(max_weight, misfit)));
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

namespace {

// A border edge, directed along increasing x or y, with its position on that axis.
struct BorderEdge {
  BorderEdge(const HeightField& height_field, Corner low, Corner high) : field(height_field) {
    if (high.x < low.x || high.y < low.y) std::swap(low, high);
    along_x = low.y == high.y;
    across = along_x ? low.y : low.x;
    a = along_x ? low.x : low.y;
    b = along_x ? high.x : high.y;
    h_a = low.z;
    h_b = high.z;
  }

  double HeightAt(int k) const { return static_cast<double>(along_x ? field.At(k, across) : field.At(across, k)); }
  double ChordAt(int k) const { return (h_a * (b - k) + h_b * (k - a)) / (b - a); }
  std::uint32_t SampleAt(int k) const { return along_x ? SampleNumber(k, across) : SampleNumber(across, k); }

  const HeightField& field;
  bool along_x = false;
  int across = 0, a = 0, b = 0;
  double h_a = 0, h_b = 0;
};

}  // namespace

Side SideOf(const HeightField& field, const Corner& a, const Corner& b) {
  if (a.y == b.y) return a.y == 0 ? Side::kSouth : Side::kNorth;
  return a.x == field.width() - 1 ? Side::kEast : Side::kWest;
}

Candidate WorstBorderSample(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options) {
  const BorderEdge edge(field, a, b);
  const float* const heights = edge.along_x ? field.Row(edge.across) + edge.a : field.Row(edge.a) + edge.across;
  const int stride = edge.along_x ? 1 : field.stride();
  const ChordMisfit worst = WorstOfChord({edge.a, edge.b, edge.h_a, edge.h_b, heights, stride}, options);
  return worst.error > 0 ? Candidate{worst.error, edge.SampleAt(worst.at)} : Candidate();
}

Candidate WorstLimitedBorderSample(const HeightField& field, const Corner& a, const Corner& b,
                                   const BorderOptions& options, const SampleLimits& limits) {
  const BorderEdge edge(field, a, b);
  const double of_chord_m = options.rounding * std::abs(edge.h_b - edge.h_a) / (edge.b - edge.a);
  Candidate worst;
  for (int k = edge.a + 1; k < edge.b; ++k) {
    const double misfit =
        std::abs(edge.ChordAt(k) - edge.HeightAt(k)) + options.sagitta_m * (k - edge.a) * (edge.b - k);
    if (std::isnan(misfit)) continue;
    const int x = edge.along_x ? k : edge.across, y = edge.along_x ? edge.across : k;
    const std::size_t sample =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(field.width()) + static_cast<std::size_t>(x);
    const bool has_limit = limits.HasLimit(sample);
    const double padded = misfit + (has_limit ? of_chord_m : options.padding_m);
    const double weighted = std::max(padded * options.weight, padded + options.step_m);
    const double error =
        options.scale * limits.WeightedError(
                            sample, has_limit && misfit > 0 ? weighted : std::min(weighted, kMaxBorderWeight * misfit));
    if (error > worst.error) worst = {error, edge.SampleAt(k)};
  }
  return worst;
}

double SquaredBorderDistances(const HeightField& field, const Corner& a, const Corner& b) {
  const BorderEdge edge(field, a, b);
  double sum = 0;
  for (int k = edge.a + 1; k < edge.b; ++k) {
    const double distance = edge.ChordAt(k) - edge.HeightAt(k);
    if (!std::isnan(distance)) sum += distance * distance;
  }
  return sum;
}

}  // namespace terrace::tin
#endif
