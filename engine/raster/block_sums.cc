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

void AddPairs(const float* samples, double weight, std::span<BlockSum> sums) {
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

// Blocks of a multiple of 4 samples: vectors of 4 blocks, whose samples are transposed, 4 of each at a time.
void AddBlocks(const float* samples, std::size_t block, double weight, std::span<BlockSum> sums) {
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR  // has no lanes to transpose
  const hn::CappedTag<double, 4> d;
  if constexpr (hn::MaxLanes(d) == 4) {
    const hn::Rebind<float, decltype(d)> f;
    using F = decltype(f);
    const auto weight_of = hn::Set(d, weight);
    for (; i + 4 <= sums.size(); i += 4) {
      hn::Vec<decltype(d)> sum, weights;
      hn::LoadInterleaved2(d, &sums[i].sum, sum, weights);
      const float* const first = samples + i * block;
      for (std::size_t k = 0; k < block; k += 4) {
        const auto a = hn::LoadU(f, first + k), b = hn::LoadU(f, first + block + k);
        const auto c = hn::LoadU(f, first + 2 * block + k), e = hn::LoadU(f, first + 3 * block + k);
        const auto lower_ab = hn::InterleaveLower(f, a, b), upper_ab = hn::InterleaveUpper(f, a, b);
        const auto lower_ce = hn::InterleaveLower(f, c, e), upper_ce = hn::InterleaveUpper(f, c, e);
        AddSamples<decltype(d), F>(d, hn::ConcatLowerLower(f, lower_ce, lower_ab), weight_of, sum, weights);
        AddSamples<decltype(d), F>(d, hn::ConcatUpperUpper(f, lower_ce, lower_ab), weight_of, sum, weights);
        AddSamples<decltype(d), F>(d, hn::ConcatLowerLower(f, upper_ce, upper_ab), weight_of, sum, weights);
        AddSamples<decltype(d), F>(d, hn::ConcatUpperUpper(f, upper_ce, upper_ab), weight_of, sum, weights);
      }
      hn::StoreInterleaved2(sum, weights, d, &sums[i].sum);
    }
  }
#endif
  for (; i < sums.size(); ++i) {
    BlockSum sum = sums[i];
    for (std::size_t k = 0; k < block; ++k) sum.Add(samples[i * block + k], weight);
    sums[i] = sum;
  }
}

void Take(std::span<BlockSum> sums, float* means) {
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
    hn::StoreInterleaved2(zero, zero, d, &sums[i].sum);
  }
  for (; i < sums.size(); ++i) {
    means[i] = sums[i].Mean();
    sums[i] = {};
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(AddPairs);
HWY_EXPORT(AddBlocks);
HWY_EXPORT(Take);

}  // namespace

void AddRowOfBlocks(const float* samples, int block, double weight, std::span<BlockSum> sums) {
  if (block == 2) return HWY_DYNAMIC_DISPATCH(AddPairs)(samples, weight, sums);
  if (block % 4 == 0) return HWY_DYNAMIC_DISPATCH(AddBlocks)(samples, static_cast<std::size_t>(block), weight, sums);
  for (BlockSum& to : sums) {
    BlockSum sum = to;
    for (const float* const end = samples + block; samples != end; ++samples) sum.Add(*samples, weight);
    to = sum;
  }
}

void TakeMeans(std::span<BlockSum> sums, float* means) { HWY_DYNAMIC_DISPATCH(Take)(sums, means); }

}  // namespace terrace::dem
#endif
