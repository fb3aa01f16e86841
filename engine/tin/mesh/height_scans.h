// What a height field must know of all of its samples: voids, the range of heights, and their quantum.
#pragma once

#include <cstddef>

namespace terrace::tin {

struct ValidHeights {
  float lowest = 0, highest = 0;  // metres; no valid sample: lowest > highest
  std::size_t voids = 0;
};

// Replaces values that are not finite by NaN, which means a void, and returns the range of the others. Safe to call
// from many threads at once.
ValidHeights MarkVoids(float* heights, std::size_t count);

// The quantum of heights, a common divisor, decides where single precision is exact in scans: the largest of 1, 2^-10
// and 2^-14 metres that all heights are multiples of; 0 if none is. NaN is a multiple of anything.
float QuantumOf(const float* heights, std::size_t count);

}  // namespace terrace::tin
