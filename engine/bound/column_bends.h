// The largest first and second differences of samples, by column, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <cstddef>
#include <vector>

namespace terrace::dem {

// By column: the largest |difference| of a sample from the next one to the east (x) and to the south (y), of two
// differences that follow each other (xx, yy), and of the eastern differences of two rows (xy). Differences that are
// NaN do not count. Samples without the neighbour have no such difference. And the sums of the samples, NaN if one is.
struct ColumnBends {
  std::vector<float> x, y, xx, yy, xy, sum;

  void Resize(std::size_t columns);
  std::size_t columns() const { return sum.size(); }
};

// Measures `rows` rows of bends.columns() samples; the rows begin `stride` samples apart.
void MeasureBends(const float* samples, std::size_t stride, std::size_t rows, ColumnBends& bends);

}  // namespace terrace::dem
