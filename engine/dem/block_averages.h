// Sums of blocks of samples, in the one order that decides an average's last bit.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/dem/sample_rules.h"

namespace terrace::dem {

struct BlockSum {
  double sum = 0;
  std::int64_t count = 0;  // of valid samples

  void Add(float sample) {
    if (std::isnan(sample)) return;
    sum += sample;
    ++count;
  }
  void Add(const BlockSum& other) {
    sum += other.sum;
    count += other.count;
  }
  float Mean() const { return count == 0 ? SampleRules::kVoid : static_cast<float>(sum / static_cast<double>(count)); }
};

// Averages of a row of blocks of block x block samples, from rows of samples. A block is summed row by row; one of more
// than kLargestPlain samples a side, by blocks of that size, each of them row by row: so large averages can be made
// from parts of the raster that fit into memory (raster_survey.h), bit for bit.
class BlockAverages {
 public:
  static constexpr int kLargestPlain = 1024;

  BlockAverages(std::int64_t blocks, int block)
      : block_(block),
        parts_(block > kLargestPlain ? block / kLargestPlain : 1),
        inner_(static_cast<std::size_t>(blocks * parts_)),
        outer_(parts_ > 1 ? static_cast<std::size_t>(blocks) : 0) {}

  void AddRow(const float* samples, std::int64_t count) {
    const std::int64_t plain = block_ / parts_;
    std::size_t at = 0;
    for (std::int64_t first = 0; first < count; first += plain, ++at) {
      BlockSum sum = inner_[at];
      const std::int64_t end = first + plain < count ? first + plain : count;
      for (std::int64_t i = first; i < end; ++i) sum.Add(samples[i]);
      inner_[at] = sum;
    }
    if (parts_ > 1 && ++rows_ == kLargestPlain) Gather();
  }

  // After a block's last row: its averages, and from the beginning.
  void Take(float* out) {
    if (parts_ > 1 && rows_ > 0) Gather();
    for (BlockSum& sum : parts_ > 1 ? outer_ : inner_) {
      *out++ = sum.Mean();
      sum = {};
    }
  }

 private:
  void Gather() {
    for (std::size_t i = 0; i < inner_.size(); ++i) {
      outer_[i / static_cast<std::size_t>(parts_)].Add(inner_[i]);
      inner_[i] = {};
    }
    rows_ = 0;
  }

  int block_, parts_;
  int rows_ = 0;                 // in inner_, where it is gathered
  std::vector<BlockSum> inner_;  // of blocks, or of their parts
  std::vector<BlockSum> outer_;
};

}  // namespace terrace::dem
