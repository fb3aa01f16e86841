// Averages of blocks of samples, as the rows of the samples come in.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/dem/sample_rules.h"

namespace terrace::dem {

// Of a row of blocks, each `block` samples wide. Every block is summed row by row, whatever lies beside it.
class BlockAverages {
 public:
  BlockAverages(std::int64_t blocks, int block)
      : block_(block), sums_(static_cast<std::size_t>(blocks)), weights_(sums_.size()) {}

  // Each sample counts `weight` times, the last of the row `last` times of that: it may stand for fewer pixels.
  void AddRow(const float* samples, std::int64_t count, double weight = 1, double last = 1) {
    for (std::int64_t i = 0; i < count; ++i) {
      if (std::isnan(samples[i])) continue;
      const double here = i + 1 == count ? weight * last : weight;
      sums_[static_cast<std::size_t>(i / block_)] += here * samples[i];
      weights_[static_cast<std::size_t>(i / block_)] += here;
    }
  }
  // NaN for a block without a valid sample. The next row of blocks begins.
  void Take(float* out) {
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      out[i] = weights_[i] == 0 ? SampleRules::kVoid : static_cast<float>(sums_[i] / weights_[i]);
      sums_[i] = 0;
      weights_[i] = 0;
    }
  }

 private:
  int block_;
  std::vector<double> sums_, weights_;
};

}  // namespace terrace::dem
