// Sums of the samples of blocks, and their means, for whole rows of blocks. Results are bit-equal on all sets of
// instructions.
//
// A block of 2 x 2 samples is summed row by row, and a block of 2n x 2n samples is the sum of its four quarters, row by
// row. So one pass over the samples gives the sums of all sizes, and a sum depends neither on the window nor on the
// part of the raster that is read at once. The rounding error grows with the logarithm of the number of samples
// (pairwise summation: N. J. Higham, "The accuracy of floating point summation", 1993).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gdal/sample_rules.h"

namespace terrace::dem {

struct BlockSum {
  double sum = 0, weight = 0;  // of valid samples

  void Add(float sample, double times = 1) {
    if (std::isnan(sample)) return;
    sum += times * sample;
    weight += times;
  }
  void Add(const BlockSum& other) {
    sum += other.sum;
    weight += other.weight;
  }
  float Mean() const { return weight == 0 ? SampleRules::kVoid : static_cast<float>(sum / weight); }
};

// Adds samples 2i and 2i + 1 to sum i, each with this weight. `samples` has two elements for each sum.
void AddPairs(const float* samples, double weight, std::span<BlockSum> sums);

// Adds values 2i and 2i + 1 to sum i. `sums` has at least half as many elements, rounded up.
void AddPairs(std::span<const BlockSum> values, std::span<BlockSum> sums);

// Writes the mean of each sum; NaN without a valid sample.
void WriteMeans(std::span<const BlockSum> sums, float* means);

// Sums of blocks of 2 x 2, 4 x 4, ... `block` x `block` values, accumulated row by row. Values are samples, or sums of
// smaller blocks.
class BlockSums {
 public:
  // `values`: of a row. `block`: a power of two. There are as many sums of a side as blocks that the row reaches.
  BlockSums(std::int64_t values, int block) {
    for (int side = 2; side <= block; side *= 2) {
      values = (values + 1) / 2;
      levels_.emplace_back(static_cast<std::size_t>(values));
    }
  }

  // Adds a row of samples with weight `weight`. The last sample has `weight` * `last`: it may cover fewer pixels. Calls
  // visit(side, row, sums) for each row of blocks of side x side values that is now complete. `row`: of blocks of this
  // side, since the last call of Finish; `sums` is a span.
  template <typename Visit>
  void AddRow(const float* samples, std::int64_t count, double weight, double last, const Visit& visit) {
    std::vector<BlockSum>& sums = levels_.front();
    const std::int64_t pairs = (last == 1 ? count : count - 1) / 2;  // of samples of equal weight
    AddPairs(samples, weight, std::span(sums).first(static_cast<std::size_t>(pairs)));
    for (std::int64_t i = 2 * pairs; i < count; ++i) {
      sums[static_cast<std::size_t>(i / 2)].Add(samples[i], i + 1 == count ? weight * last : weight);
    }
    EndRow(visit);
  }
  template <typename Visit>
  void AddRow(std::span<const BlockSum> values, const Visit& visit) {
    AddPairs(values, levels_.front());
    EndRow(visit);
  }

  // Completes the blocks that lack rows, because the raster ends. The next row begins other blocks.
  template <typename Visit>
  void Finish(const Visit& visit) {
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      const std::int64_t side = std::int64_t{2} << k;
      if (rows_ % side != 0) Complete(k, rows_ / side, visit);
    }
    rows_ = 0;
  }

 private:
  template <typename Visit>
  void EndRow(const Visit& visit) {
    ++rows_;
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      const std::int64_t side = std::int64_t{2} << k;
      if (rows_ % side != 0) return;
      Complete(k, rows_ / side - 1, visit);
    }
  }
  template <typename Visit>
  void Complete(std::size_t k, std::int64_t row, const Visit& visit) {
    visit(2 << k, row, std::span<const BlockSum>(levels_[k]));
    if (k + 1 < levels_.size()) AddPairs(levels_[k], levels_[k + 1]);
    levels_[k].assign(levels_[k].size(), {});
  }

  std::vector<std::vector<BlockSum>> levels_;  // blocks of 2 x 2, 4 x 4, ...
  std::int64_t rows_ = 0;                      // of values since the last call of Finish
};

}  // namespace terrace::dem
