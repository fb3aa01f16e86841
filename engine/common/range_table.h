// The lowest and highest height, voids and holes of each block of 64 x 64 source pixels, and of blocks of blocks on
// coarser levels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace terrace::dem {

struct BlockRange {
  float min = std::numeric_limits<float>::infinity();  // min > max: nothing but voids
  float max = -std::numeric_limits<float>::infinity();
  bool has_voids = false;
  bool has_enclosed_voids = false;  // voids with data all around them, which do not touch the raster's rim

  void Add(float height);  // NaN: a void
  void Add(const BlockRange& other);
};

// Filled by one thread, then immutable and thread-safe.
class RangeTable {
 public:
  static constexpr int kBlock = 64;  // source pixels

  RangeTable() = default;
  RangeTable(int width, int height);

  // Adds the heights of a pixel window. `pixel_step`: their spacing in source pixels (1, or the factor of averages).
  void AddWindow(int col, int row, int cols, int rows, const float* heights, int pixel_step = 1);

  // Adds ranges of finest blocks: a window `columns` wide that begins at the given block.
  void AddBlocks(int block_column, int block_row, int columns, const std::vector<BlockRange>& ranges);

  // Marks samples first .. last of a row as voids of a hole.
  void MarkHole(int row, int first, int last);

  // The range of all finest blocks so far.
  BlockRange OfFinest() const;
  const std::vector<BlockRange>& finest() const { return levels_.front().blocks; }

  // Makes the coarser levels. Call once after the last AddWindow and before the first Query.
  void Finish();

  // Returns a range that contains all pixels in the box (columns and rows, ends included, clipped to the raster). Takes
  // constant time: coarse blocks answer for large boxes.
  BlockRange Query(double west, double north, double east, double south) const;

  BlockRange Whole() const { return levels_.back().blocks.front(); }

  // Memory of the blocks.
  std::size_t bytes() const;

  // Returns a copy without the levels of more than `max_blocks` blocks. It answers queries of large boxes only
  // (TryQuery).
  RangeTable Coarse(std::size_t max_blocks) const;
  // Query, or nothing if that needs a level that this table does not have.
  std::optional<BlockRange> TryQuery(double west, double north, double east, double south) const;

 private:
  struct Level {
    int columns = 0, rows = 0;
    std::vector<BlockRange> blocks;

    BlockRange& At(std::int64_t column, std::int64_t row) {
      return blocks[static_cast<std::size_t>(row * columns + column)];
    }
    const BlockRange& At(std::int64_t column, std::int64_t row) const {
      return blocks[static_cast<std::size_t>(row * columns + column)];
    }
  };
  int width_ = 0, height_ = 0;
  std::vector<Level> levels_;
};

}  // namespace terrace::dem
