// The largest first and second differences of samples, by column, with SIMD. Results are bit-equal on all instruction
// sets.
#pragma once

#include <cstddef>
#include <vector>

namespace terrace::dem {

// By column i, the largest magnitudes, in metres, of differences of the samples h(i, j) in rows j:
//   x(i, j) = h(i + 1, j) - h(i, j)    y(i, j) = h(i, j + 1) - h(i, j)
//   xx(i, j) = x(i + 1, j) - x(i, j)   yy(i, j) = y(i, j + 1) - y(i, j)   xy(i, j) = x(i, j + 1) - x(i, j)
// Differences that are NaN do not count. Samples without the neighbours have no such difference. `sum`: of the samples,
// NaN if one is.
struct ColumnDifferences {
  std::vector<float> x, y, xx, yy, xy, sum;

  void Resize(std::size_t columns);
  std::size_t columns() const { return sum.size(); }
};

// Measures `rows` rows of differences.columns() samples; the rows begin `stride` samples apart.
void MeasureDifferences(const float* samples, std::size_t stride, std::size_t rows, ColumnDifferences& differences);

}  // namespace terrace::dem
