// Differences of samples are measured in vectors; what comes out is what each sample gives on its own.
#include "engine/bound/column_differences.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

void Raise(float& largest, float value) {
  if (std::abs(value) > largest) largest = std::abs(value);
}

// Sample by sample.
ColumnDifferences Expected(const std::vector<std::vector<float>>& rows) {
  ColumnDifferences bends;
  const std::size_t columns = rows.front().size();
  bends.Resize(columns);
  for (std::size_t j = 0; j < rows.size(); ++j) {
    const auto at = [&](std::size_t row, std::size_t c) { return rows[row][c]; };
    for (std::size_t c = 0; c < columns; ++c) {
      const bool has_east = c + 1 < columns, has_south = j + 1 < rows.size();
      bends.sum[c] += at(j, c);
      if (has_east) Raise(bends.x[c], at(j, c + 1) - at(j, c));
      if (c + 2 < columns) Raise(bends.xx[c], at(j, c + 2) - at(j, c + 1) - (at(j, c + 1) - at(j, c)));
      if (has_south) Raise(bends.y[c], at(j + 1, c) - at(j, c));
      if (has_south && j > 0) Raise(bends.yy[c], at(j + 1, c) - at(j, c) - (at(j, c) - at(j - 1, c)));
      if (has_south && has_east) Raise(bends.xy[c], at(j, c + 1) - at(j, c) - (at(j + 1, c + 1) - at(j + 1, c)));
    }
  }
  return bends;
}

TEST(ColumnDifferences, AreThoseOfSingleSamples) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> metres(-500, 3000);
  for (std::size_t columns = 1; columns <= 50; ++columns) {
    std::vector<std::vector<float>> rows(4, std::vector<float>(columns));
    for (auto& row : rows) std::ranges::generate(row, [&] { return metres(random); });
    if (columns % 5 == 0) rows[2][columns / 2] = std::numeric_limits<float>::quiet_NaN();
    const ColumnDifferences expected = Expected(rows);
    const std::size_t stride = columns + 3;
    std::vector<float> samples;
    for (const auto& row : rows) {
      samples.insert(samples.end(), row.begin(), row.end());
      samples.resize(samples.size() + stride - columns, 9e9f);  // must not be used
    }
    samples.resize(samples.size() - (stride - columns));
    tin::ForEachInstructionSet([&] {
      ColumnDifferences bends;
      bends.Resize(columns);
      MeasureDifferences(samples.data(), stride, rows.size(), bends);
      EXPECT_EQ(bends.x, expected.x) << columns;
      EXPECT_EQ(bends.y, expected.y) << columns;
      EXPECT_EQ(bends.xx, expected.xx) << columns;
      EXPECT_EQ(bends.yy, expected.yy) << columns;
      EXPECT_EQ(bends.xy, expected.xy) << columns;
      for (std::size_t c = 0; c < columns; ++c) {
        EXPECT_EQ(std::isnan(bends.sum[c]), std::isnan(expected.sum[c])) << columns;
        if (!std::isnan(bends.sum[c])) {
          EXPECT_EQ(bends.sum[c], expected.sum[c]) << columns;
        }
      }
    });
  }
}

}  // namespace
}  // namespace terrace::dem
