// Voids and the range of heights of samples, before a height field is made of them.
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

}  // namespace terrace::tin
