// Sums of the samples of blocks, and their means, for whole rows of blocks, with SIMD. Results are bit-equal on all
// sets of instructions.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

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

// Adds the first `block` samples of a row to the first sum, the next ones to the second, ..., each sample with this
// weight. Equal to calls of BlockSum::Add in the order of the samples.
void AddRowOfBlocks(const float* samples, int block, double weight, std::span<BlockSum> sums);

// Writes the mean of each sum, and sets the sums to zero.
void TakeMeans(std::span<BlockSum> sums, float* means);

}  // namespace terrace::dem
