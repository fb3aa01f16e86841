// Statistics of rows of samples, with SIMD. Results are bit-equal on all sets of instructions.
// Samples are never -0.
#pragma once

#include <cstdint>
#include <span>

#include "engine/common/range_table.h"

namespace terrace::dem {

// Adds samples to a range. Returns the number of those that are not void.
std::int64_t AddToRange(std::span<const float> samples, BlockRange& range);

// Samples of a row between averages of n = weights.size() samples each. Run i is the n samples between the centres of
// averages i and i + 1. `weights`: the distance of a run's samples from the centre of average i, as a fraction of the
// distance between the centres.
struct SampleRuns {
  const float* samples = nullptr;
  const double* averages = nullptr;  // runs + 1
  std::size_t runs = 0;
  std::span<const double> weights;  // 2 or a multiple of 4
};

// The largest distance of a sample from the line between its averages. Voids do not count. No average is void.
double LargestDistance(const SampleRuns& runs);

}  // namespace terrace::dem
