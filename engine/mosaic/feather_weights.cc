#include "engine/mosaic/feather_weights.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace terrace::dem {
namespace {

// Rows from each sample to the nearest void in its column, at most `most` + 1. One void row lies above and below all.
std::vector<int> RowsToVoid(const std::vector<float>& heights, std::int64_t columns, std::int64_t rows, int most) {
  std::vector<int> steps(heights.size());
  std::vector<int> from_north(static_cast<std::size_t>(columns)), from_south = from_north;
  const auto pass = [&](std::int64_t row, std::vector<int>& known, bool is_second) {
    const float* const height = heights.data() + row * columns;
    int* const step = steps.data() + row * columns;
    int* const here = known.data();
    for (std::int64_t c = 0; c < columns; ++c) {
      const int next = std::min(here[c] + 1, most + 1);
      here[c] = std::isnan(height[c]) ? 0 : next;
      step[c] = is_second ? std::min(step[c], here[c]) : here[c];
    }
  };
  for (std::int64_t r = 0; r < rows; ++r) pass(r, from_north, false);
  for (std::int64_t r = rows - 1; r >= 0; --r) pass(r, from_south, true);
  return steps;
}

}  // namespace

std::vector<float> FeatherWeights(const std::vector<float>& wide_heights, const GridWindow& wide,
                                  const GridWindow& core, double column_step, double row_step, double length) {
  const int max_columns = static_cast<int>(std::ceil(length / column_step));
  const int max_rows = static_cast<int>(std::ceil(length / row_step));
  const std::vector<int> rows = RowsToVoid(wide_heights, wide.columns, wide.rows, max_rows);
  const double farthest = length * length;
  std::vector<float> weights(static_cast<std::size_t>(core.columns * core.rows));
  float* out = weights.data();
  // Squares of the distances in a row of `core`, and those along the columns, with columns outside of `wide` on both
  // sides.
  std::vector<double> nearest(static_cast<std::size_t>(core.columns));
  std::vector<double> in_column(static_cast<std::size_t>(core.columns + 2 * max_columns));
  const std::int64_t west = core.column - wide.column - max_columns;  // of in_column, in `wide`
  for (std::int64_t r = 0; r < core.rows; ++r, out += core.columns) {
    const int* const row = rows.data() + (core.row - wide.row + r) * wide.columns;
    double least = farthest;
    for (std::size_t i = 0; i < in_column.size(); ++i) {
      const std::int64_t column = west + static_cast<std::int64_t>(i);
      const double y = column < 0 || column >= wide.columns ? 0 : row[column] * row_step;
      in_column[i] = y * y;
      least = std::min(least, in_column[i]);
    }
    std::ranges::fill(nearest, farthest);
    const double* const middle = in_column.data() + max_columns;
    for (int dx = 0; dx <= max_columns; ++dx) {
      const double x = dx * column_step, square = x * x;
      if (square + least >= farthest) break;
      for (std::int64_t c = 0; c < core.columns; ++c) {
        const double beside = std::min(middle[c - dx], middle[c + dx]);
        nearest[static_cast<std::size_t>(c)] = std::min(nearest[static_cast<std::size_t>(c)], square + beside);
      }
    }
    for (std::int64_t c = 0; c < core.columns; ++c) {
      out[c] = static_cast<float>(std::sqrt(nearest[static_cast<std::size_t>(c)]) / length);
    }
  }
  return weights;
}

}  // namespace terrace::dem
