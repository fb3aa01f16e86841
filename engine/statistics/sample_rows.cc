#include "engine/statistics/sample_rows.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/statistics/sample_rows.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Calls step(lane) for each lane. Highway's reductions are not exact for infinities with every compiler.
template <class D, class Step>
void ForLanes(D d, hn::Vec<D> v, const Step& step) {
  HWY_ALIGN hn::TFromD<D> lanes[hn::MaxLanes(d)];
  hn::Store(v, d, lanes);
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) step(lanes[i]);
}

std::int64_t AddTo(std::span<const float> samples, BlockRange& range) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  auto least = hn::Set(d, range.min), most = hn::Set(d, range.max);
  std::size_t i = 0, valid = 0;
  for (; i + lanes <= samples.size(); i += lanes) {
    const auto height = hn::LoadU(d, samples.data() + i);
    valid += hn::CountTrue(d, hn::Eq(height, height));
    least = hn::IfThenElse(hn::Lt(height, least), height, least);  // never a void
    most = hn::IfThenElse(hn::Gt(height, most), height, most);
  }
  ForLanes(d, least, [&](float height) { range.min = std::min(range.min, height); });
  ForLanes(d, most, [&](float height) { range.max = std::max(range.max, height); });
  for (; i < samples.size(); ++i) {
    if (std::isnan(samples[i])) continue;
    range.min = std::min(range.min, samples[i]);
    range.max = std::max(range.max, samples[i]);
    ++valid;
  }
  range.has_voids |= valid < samples.size();
  return static_cast<std::int64_t>(valid);
}

template <class V>
HWY_INLINE V Larger(V worst, V average, V step, V weight, V sample) {
  const V distance = hn::Abs(hn::Sub(hn::Add(average, hn::Mul(weight, step)), sample));
  return hn::IfThenElse(hn::Gt(distance, worst), distance, worst);
}

// One lane for each run. Returns how many runs were measured.
template <class D>
HWY_INLINE std::size_t MeasureShort(D d, const SampleRuns& runs, hn::Vec<D>& worst) {
  const hn::Rebind<float, D> f;
  using F = decltype(f);
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  for (; i + lanes <= runs.runs; i += lanes) {
    const auto average = hn::LoadU(d, runs.averages + i), step = hn::Sub(hn::LoadU(d, runs.averages + i + 1), average);
    const auto add = [&](hn::Vec<F> samples, std::size_t k) HWY_ATTR {
      worst = Larger(worst, average, step, hn::Set(d, runs.weights[k]), hn::PromoteTo(d, samples));
    };
    hn::Vec<F> first, second, third, fourth;
    if (runs.weights.size() == 2) {
      hn::LoadInterleaved2(f, runs.samples + 2 * i, first, second);
      add(first, 0);
      add(second, 1);
    } else {
      hn::LoadInterleaved4(f, runs.samples + 4 * i, first, second, third, fourth);
      add(first, 0);
      add(second, 1);
      add(third, 2);
      add(fourth, 3);
    }
  }
  return i;
}

double Largest(const SampleRuns& runs) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<float, decltype(d)> f;
  const std::size_t lanes = hn::Lanes(d), length = runs.weights.size();
  auto worst = hn::Zero(d);
  std::size_t i = 0;
  if (length == 2 || length == 4) {
    i = MeasureShort(d, runs, worst);
  } else if (length % lanes == 0) {
    for (; i < runs.runs; ++i) {
      const auto average = hn::Set(d, runs.averages[i]);
      const auto step = hn::Set(d, runs.averages[i + 1] - runs.averages[i]);
      for (std::size_t k = 0; k < length; k += lanes) {
        const auto samples = hn::PromoteTo(d, hn::LoadU(f, runs.samples + i * length + k));
        worst = Larger(worst, average, step, hn::LoadU(d, runs.weights.data() + k), samples);
      }
    }
  }
  double largest = 0;
  ForLanes(d, worst, [&](double distance) { largest = std::max(largest, distance); });
  for (; i < runs.runs; ++i) {
    const double average = runs.averages[i], step = runs.averages[i + 1] - average;
    for (std::size_t k = 0; k < length; ++k) {
      const double distance = std::abs(average + runs.weights[k] * step - double{runs.samples[i * length + k]});
      if (distance > largest) largest = distance;
    }
  }
  return largest;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(AddTo);
HWY_EXPORT(Largest);

}  // namespace

std::int64_t AddToRange(std::span<const float> samples, BlockRange& range) {
  return HWY_DYNAMIC_DISPATCH(AddTo)(samples, range);
}

double LargestDistance(const SampleRuns& runs) { return HWY_DYNAMIC_DISPATCH(Largest)(runs); }

}  // namespace terrace::dem
#endif
