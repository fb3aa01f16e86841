// The largest first and second differences of samples, by column, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <cstddef>
#include <vector>

namespace terrace::dem {

// By column: the largest |difference| of a sample from the next one to the east (x) and to the south (y), of two
// differences that follow each other (xx, yy), and of the eastern differences of two rows (xy). Differences that are
// NaN do not count. And the sums of the samples, NaN if one is.
struct ColumnBends {
  std::vector<float> x, y, xx, yy, xy, sum;

  void Reset(std::size_t columns);
};

// Adds the row `here` of as many samples as `bends` has columns. `above`, `below`: its neighbours; null: there is none.
// Only a row with a southern neighbour has differences in y, and only one with both neighbours has yy.
void AddRow(const float* above, const float* here, const float* below, ColumnBends& bends);

}  // namespace terrace::dem
