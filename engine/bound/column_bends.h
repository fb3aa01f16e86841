// The largest first and second differences of samples, by column, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <cstddef>
#include <vector>

namespace terrace::dem {

// By column, the largest magnitudes in metres of differences of samples h(column i, row j): x = h(i + 1, j) - h(i, j),
// y = h(i, j + 1) - h(i, j), xx and yy = differences of two of these that follow each other, xy = x(i, j + 1) - x(i,
// j). Differences that are NaN do not count. Samples without the neighbour have no such difference. `sum`: of the
// samples, NaN if one is.
struct ColumnBends {
  std::vector<float> x, y, xx, yy, xy, sum;

  void Resize(std::size_t columns);
  std::size_t columns() const { return sum.size(); }
};

// Measures `rows` rows of bends.columns() samples; the rows begin `stride` samples apart.
void MeasureBends(const float* samples, std::size_t stride, std::size_t rows, ColumnBends& bends);

}  // namespace terrace::dem
