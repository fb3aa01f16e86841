#include "engine/mosaic/feather_weights.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace terrace::dem {
namespace {

// Rows from each sample to the nearest void in its column, at most `most` + 1. One void row lies above and below all.
std::vector<int> RowsToVoid(const std::vector<float>& heights, std::int64_t columns, std::int64_t rows, int most) {
  std::vector<int> steps(heights.size());
  for (std::int64_t c = 0; c < columns; ++c) {
    const auto at = [&](std::int64_t r) { return static_cast<std::size_t>(r * columns + c); };
    int here = 0;
    for (std::int64_t r = 0; r < rows; ++r) {
      here = std::isnan(heights[at(r)]) ? 0 : std::min(here + 1, most + 1);
      steps[at(r)] = here;
    }
    here = 0;
    for (std::int64_t r = rows - 1; r >= 0; --r) {
      here = std::isnan(heights[at(r)]) ? 0 : std::min(here + 1, most + 1);
      steps[at(r)] = std::min(steps[at(r)], here);
    }
  }
  return steps;
}

}  // namespace

std::vector<float> FeatherWeights(const std::vector<float>& wide_heights, const GridWindow& wide,
                                  const GridWindow& core, double column_step, double row_step, double length) {
  const int max_columns = static_cast<int>(std::ceil(length / column_step));
  const int max_rows = static_cast<int>(std::ceil(length / row_step));
  const std::vector<int> rows = RowsToVoid(wide_heights, wide.columns, wide.rows, max_rows);
  std::vector<float> weights;
  weights.reserve(static_cast<std::size_t>(core.columns * core.rows));
  for (std::int64_t r = core.row - wide.row; r < core.row - wide.row + core.rows; ++r) {
    const int* const row = rows.data() + r * wide.columns;
    for (std::int64_t c = core.column - wide.column; c < core.column - wide.column + core.columns; ++c) {
      double nearest = length * length;
      for (int dx = -max_columns; dx <= max_columns; ++dx) {
        const std::int64_t column = c + dx;
        const double x = dx * column_step;
        const double y = column < 0 || column >= wide.columns ? 0 : row[column] * row_step;
        nearest = std::min(nearest, x * x + y * y);
      }
      weights.push_back(static_cast<float>(std::sqrt(nearest) / length));
    }
  }
  return weights;
}

}  // namespace terrace::dem
