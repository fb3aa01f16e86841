// Averages of blocks of samples in memory (block_sums.h); raster_layout.h reads averages of a raster, and
// declares GridAxis and GridWindow. The order of summation is fixed, so results are bit-identical.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/raster/block_sums.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// Returns the fraction of a block of `step` samples that lies on an axis of `size` samples; below 1 for a partial last
// block.
inline double ShareOf(std::int64_t block, int step, std::int64_t size) {
  return static_cast<double>(std::min<std::int64_t>(step, size - block * step)) / step;
}

// Copies averages of 1 x 1 blocks: the samples, `columns` per row, with -0 replaced by 0. `stride`: of `out`, in
// samples.
inline void CopyRows(const float* samples, std::int64_t columns, std::int64_t rows, float* out, std::int64_t stride) {
  for (std::int64_t r = 0; r < rows; ++r, samples += columns, out += stride) {
    for (std::int64_t i = 0; i < columns; ++i) out[i] = samples[i] + 0.0f;
  }
}

// Computes a window of averages of block x block values. Each value covers a block of `step` samples; `columns` and
// `rows` are the axes of the values. Calls read(window, add) for windows of values that do not wrap; it passes their
// rows to `add` (sample_rules.h).
template <typename Read>
Result<std::vector<float>> AverageBlocks(const GridAxis& columns, const GridAxis& rows, int step, int block,
                                         const GridWindow& window, const Read& read) {
  constexpr std::int64_t kValuesPerStrip = std::int64_t{1} << 20;
  const std::int64_t turn = (columns.count() + block - 1) / block;
  const std::int64_t top = window.row * block, height = std::min(rows.count() - top, window.rows * block);
  std::vector<float> heights(static_cast<std::size_t>(window.columns * window.rows));
  for (std::int64_t column = 0; column < window.columns;) {
    float* const out = heights.data() + column;
    const std::int64_t first = FloorMod(window.column + column, turn) * block;
    const std::int64_t blocks = std::min(window.columns - column, turn - first / block);
    const std::int64_t width = std::min(columns.count() - first, blocks * block);
    const double last = ShareOf(first + width - 1, step, columns.samples());
    const bool is_plain = block == 1 && width == blocks;
    BlockSums sums(width, block);
    std::int64_t done = 0;  // rows of values
    const auto visit = [&](int side, std::int64_t row, std::span<const BlockSum> of_blocks) {
      if (side == block) WriteMeans(of_blocks, out + row * window.columns);
    };
    const AddRows add = [&](const float* values, std::int64_t count) {
      if (is_plain) {
        CopyRows(values, width, count, out + done * window.columns, window.columns);
        done += count;
        return;
      }
      for (; count > 0; --count, values += width) {
        sums.AddRow(values, width, ShareOf(top + done, step, rows.samples()), last, visit);
        if (++done == height) sums.Finish(visit);
      }
    };
    // A limited number of rows at a time, because a row of blocks can be the whole raster.
    const std::int64_t strip = std::max<std::int64_t>(1, kValuesPerStrip / width);
    for (std::int64_t row = 0; row < height; row += strip) {
      const GridWindow here{first, top + row, width, std::min(strip, height - row)};
      if (const Result<void> read_here = read(here, add); !read_here) return tl::unexpected(read_here.error());
    }
    column += blocks;
  }
  return heights;
}

}  // namespace terrace::dem
