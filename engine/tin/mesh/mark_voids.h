// The samples of a height field before it is made: which are voids, and between what heights the others lie.
#pragma once

#include <cstddef>

namespace terrace::tin {

struct ValidHeights {
  float lowest = 0, highest = 0;  // metres; of no valid sample: lowest > highest
  std::size_t voids = 0;
};

// Makes a void, NaN, of all that is not finite, and tells of the rest. Safe to call from many threads at once.
ValidHeights MarkVoids(float* heights, std::size_t count);

}  // namespace terrace::tin
