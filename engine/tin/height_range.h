// What a height field's samples are before it is made: how many there are, and how far apart.
#pragma once

#include <cstddef>

namespace terrace::tin {

struct HeightRange {
  float lowest = 0, highest = 0;  // metres; of no valid sample: lowest > highest
  std::size_t voids = 0;
};

// Of all finite heights. What is not finite becomes NaN: a void.
HeightRange RangeOf(float* heights, std::size_t count);

}  // namespace terrace::tin
