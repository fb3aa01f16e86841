// Averages of blocks of samples in memory, accumulated row by row; raster_layout.h reads averages of a raster, and
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

// Averages of one row of blocks of block x block samples. Each block is summed row by row, independently of its
// neighbours. Blocks of more than kLargestPlain samples a side are summed from blocks of that size, so averages
// computed from parts of a raster that fit into memory (raster_statistics.h) have the same bits.
class BlockAverages {
 public:
  static constexpr int kLargestPlain = 1024;

  BlockAverages(std::int64_t blocks, int block)
      : parts_(block > kLargestPlain ? block / kLargestPlain : 1),
        plain_(block / parts_),
        inner_(static_cast<std::size_t>(blocks * parts_)),
        outer_(parts_ > 1 ? static_cast<std::size_t>(blocks) : 0) {}

  // Adds a row of samples with weight `weight`. The last sample has `weight` * `last`: it may cover fewer pixels.
  void AddRow(const float* samples, std::int64_t count, double weight = 1, double last = 1) {
    const std::int64_t whole = (last == 1 ? count : count - 1) / plain_;  // blocks of samples of equal weight
    AddRowOfBlocks(samples, plain_, weight, std::span(inner_).first(static_cast<std::size_t>(whole)));
    for (std::int64_t i = whole * plain_; i < count; ++i) {
      inner_[static_cast<std::size_t>(whole)].Add(samples[i], i + 1 == count ? weight * last : weight);
    }
    if (parts_ > 1 && ++rows_ == kLargestPlain) Gather();
  }

  // Writes one average per block, NaN for a block without a valid sample, and starts the next row of blocks.
  void Take(float* out) {
    if (parts_ > 1 && rows_ > 0) Gather();
    TakeMeans(parts_ > 1 ? outer_ : inner_, out);
  }

 private:
  void Gather() {
    for (std::size_t i = 0; i < inner_.size(); ++i) {
      outer_[i / static_cast<std::size_t>(parts_)].Add(inner_[i]);
      inner_[i] = {};
    }
    rows_ = 0;
  }

  int parts_, plain_;
  int rows_ = 0;                 // of samples in inner_ that are not gathered yet
  std::vector<BlockSum> inner_;  // of blocks, or of parts of blocks
  std::vector<BlockSum> outer_;
};

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
    BlockAverages averages(is_plain ? 0 : blocks, block);
    std::int64_t done = 0;  // rows of values
    const AddRows add = [&](const float* values, std::int64_t count) {
      if (is_plain) {
        CopyRows(values, width, count, out + done * window.columns, window.columns);
        done += count;
        return;
      }
      for (; count > 0; --count, values += width) {
        averages.AddRow(values, width, ShareOf(top + done, step, rows.samples()), last);
        ++done;
        if (done % block == 0 || done == height) averages.Take(out + (done - 1) / block * window.columns);
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
