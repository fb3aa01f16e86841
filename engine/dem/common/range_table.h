// Lowest and highest height, voids and holes per block of 64 x 64 source pixels, and of ever larger blocks above.
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
  bool has_holes = false;  // voids with data all around them: they do not touch the raster's rim

  void Add(float height);  // NaN: a void
  void Add(const BlockRange& other);
};

// Filled by one thread, then immutable and thread-safe.
class RangeTable {
 public:
  static constexpr int kBlock = 64;  // source pixels

  RangeTable() = default;
  RangeTable(int width, int height);

  // Adds the heights of a pixel window; `pixel_step` source pixels lie between them (1, or the factor of
  // averages).
  void AddWindow(int col, int row, int cols, int rows, const float* heights, int pixel_step = 1);

  // Adds ranges of finest blocks, `columns` wide, from this block on.
  void AddBlocks(int block_column, int block_row, int columns, const std::vector<BlockRange>& ranges);

  // Samples first .. last of a row are voids of a hole.
  void MarkHole(int row, int first, int last);

  // Of all finest blocks so far.
  BlockRange OfFinest() const;
  const std::vector<BlockRange>& finest() const { return levels_.front().blocks; }

  // Makes the coarser levels. Call once after the last AddWindow and before the first Query.
  void Finish();

  // At least the range of all pixels within the box (columns and rows, ends included, clipped to the raster). Cheap
  // whatever the box's size: coarse blocks answer for large boxes.
  BlockRange Query(double west, double north, double east, double south) const;

  BlockRange Whole() const { return levels_.back().blocks.front(); }

  // Of the blocks.
  std::size_t bytes() const;

  // The same without levels of more than `most` blocks: it answers for large boxes alone (TryQuery).
  RangeTable Coarse(std::size_t most) const;
  // Query; nothing where that takes a level which is not here.
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
