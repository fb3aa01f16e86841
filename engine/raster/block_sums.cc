#include "engine/raster/block_sums.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/raster/block_sums.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

static_assert(sizeof(BlockSum) == 2 * sizeof(double));

// A void adds 0, which changes no bit of a sum.
template <class D, class F>
HWY_INLINE void AddSamples(D d, hn::Vec<F> samples, hn::Vec<D> weight, hn::Vec<D>& sum, hn::Vec<D>& weights) {
  const hn::Vec<D> sample = hn::PromoteTo(d, samples);
  const auto is_valid = hn::Eq(sample, sample);
  sum = hn::Add(sum, hn::IfThenElseZero(is_valid, hn::Mul(weight, sample)));
  weights = hn::Add(weights, hn::IfThenElseZero(is_valid, weight));
}

void AddPairsOfSamples(const float* samples, double weight, std::span<BlockSum> sums) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<float, decltype(d)> f;
  using F = decltype(f);
  const std::size_t lanes = hn::Lanes(d);
  const auto weight_of = hn::Set(d, weight);
  std::size_t i = 0;
  for (; i + lanes <= sums.size(); i += lanes) {
    hn::Vec<decltype(d)> sum, weights;
    hn::Vec<F> first, second;
    hn::LoadInterleaved2(d, &sums[i].sum, sum, weights);
    hn::LoadInterleaved2(f, samples + 2 * i, first, second);
    AddSamples<decltype(d), F>(d, first, weight_of, sum, weights);
    AddSamples<decltype(d), F>(d, second, weight_of, sum, weights);
    hn::StoreInterleaved2(sum, weights, d, &sums[i].sum);
  }
  for (; i < sums.size(); ++i) {
    for (std::size_t k = 0; k < 2; ++k) sums[i].Add(samples[2 * i + k], weight);
  }
}

void Means(std::span<const BlockSum> sums, float* means) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<float, decltype(d)> f;
  const std::size_t lanes = hn::Lanes(d);
  const auto zero = hn::Zero(d), none = hn::Set(d, double{SampleRules::kVoid});
  std::size_t i = 0;
  for (; i + lanes <= sums.size(); i += lanes) {
    hn::Vec<decltype(d)> sum, weights;
    hn::LoadInterleaved2(d, &sums[i].sum, sum, weights);
    const auto mean = hn::IfThenElse(hn::Eq(weights, zero), none, hn::Div(sum, weights));
    hn::StoreU(hn::DemoteTo(f, mean), f, means + i);
  }
  for (; i < sums.size(); ++i) means[i] = sums[i].Mean();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(AddPairsOfSamples);
HWY_EXPORT(Means);

}  // namespace

void AddPairs(const float* samples, double weight, std::span<BlockSum> sums) {
  HWY_DYNAMIC_DISPATCH(AddPairsOfSamples)(samples, weight, sums);
}

void AddPairs(std::span<const BlockSum> values, std::span<BlockSum> sums) {
  const std::size_t pairs = values.size() / 2;
  for (std::size_t i = 0; i < pairs; ++i) {
    sums[i].Add(values[2 * i]);
    sums[i].Add(values[2 * i + 1]);
  }
  if (values.size() % 2 != 0) sums[pairs].Add(values.back());
}

void WriteMeans(std::span<const BlockSum> sums, float* means) { HWY_DYNAMIC_DISPATCH(Means)(sums, means); }

}  // namespace terrace::dem
#endif
