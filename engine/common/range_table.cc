#include "engine/common/range_table.h"

#include <algorithm>
#include <cmath>

#include "engine/common/dem_types.h"

namespace terrace::dem {

void BlockRange::Add(float height) {
  if (std::isnan(height)) {
    has_voids = true;
  } else {
    min = std::min(min, height);
    max = std::max(max, height);
  }
}

void BlockRange::Add(const BlockRange& other) {
  min = std::min(min, other.min);
  max = std::max(max, other.max);
  has_voids |= other.has_voids;
  has_enclosed_voids |= other.has_enclosed_voids;
}

RangeTable::RangeTable(int width, int height) : width_(width), height_(height) {
  Level finest{(width + kBlock - 1) / kBlock, (height + kBlock - 1) / kBlock, {}};
  finest.blocks.resize(Area(finest.columns, finest.rows));
  levels_.push_back(std::move(finest));
}

void RangeTable::AddWindow(int col, int row, int cols, int rows, const float* heights, int pixel_step) {
  Level& finest = levels_.front();
  // If the factor exceeds a block, an average covers pixels of several blocks.
  for (int r = 0; r < rows; ++r) {
    const std::int64_t top = std::int64_t{row + r} * pixel_step / kBlock;
    const std::int64_t bottom =
        std::min<std::int64_t>(((std::int64_t{row + r} + 1) * pixel_step - 1) / kBlock, finest.rows - 1);
    for (int c = 0; c < cols; ++c) {
      const float height = heights[IndexAt(c, r, cols)];
      const std::int64_t left = std::int64_t{col + c} * pixel_step / kBlock;
      const std::int64_t right =
          std::min<std::int64_t>(((std::int64_t{col + c} + 1) * pixel_step - 1) / kBlock, finest.columns - 1);
      for (std::int64_t y = top; y <= bottom; ++y) {
        for (std::int64_t x = left; x <= right; ++x) finest.At(x, y).Add(height);
      }
    }
  }
}

void RangeTable::AddBlocks(int block_column, int block_row, int columns, const std::vector<BlockRange>& ranges) {
  Level& finest = levels_.front();
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const int column = block_column + static_cast<int>(i) % columns, row = block_row + static_cast<int>(i) / columns;
    finest.At(column, row).Add(ranges[i]);
  }
}

void RangeTable::MarkHole(int row, int first, int last) {
  Level& finest = levels_.front();
  for (int x = first / kBlock; x <= last / kBlock; ++x) {
    finest.At(x, row / kBlock).has_enclosed_voids = true;
  }
}

BlockRange RangeTable::OfFinest() const {
  BlockRange range;
  for (const BlockRange& block : levels_.front().blocks) range.Add(block);
  return range;
}

void RangeTable::Finish() {
  while (levels_.back().blocks.size() > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
    coarse.blocks.resize(Area(coarse.columns, coarse.rows));
    for (int y = 0; y < fine.rows; ++y) {
      for (int x = 0; x < fine.columns; ++x) {
        coarse.At(x / 2, y / 2).Add(fine.At(x, y));
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

std::size_t RangeTable::bytes() const {
  std::size_t blocks = 0;
  for (const Level& level : levels_) blocks += level.blocks.size();
  return blocks * sizeof(BlockRange);
}

RangeTable RangeTable::Coarse(std::size_t max_blocks) const {
  RangeTable coarse = *this;
  for (Level& level : coarse.levels_) {
    if (level.blocks.size() > max_blocks) level.blocks = std::vector<BlockRange>();
  }
  return coarse;
}

BlockRange RangeTable::Query(double west, double north, double east, double south) const {
  return *TryQuery(west, north, east, south);
}

std::optional<BlockRange> RangeTable::TryQuery(double west, double north, double east, double south) const {
  BlockRange range;
  if (east < 0 || south < 0 || west > width_ || north > height_) return range;
  const auto pixel = [](double position, int count) {
    return static_cast<int>(std::clamp(std::floor(position), 0.0, count - 1.0));
  };
  int x0 = pixel(west, width_) / kBlock, x1 = pixel(east, width_) / kBlock;
  int y0 = pixel(north, height_) / kBlock, y1 = pixel(south, height_) / kBlock;
  constexpr int kMaxBlocksPerAxis = 12;
  std::size_t level = 0;
  while (std::max(x1 - x0, y1 - y0) >= kMaxBlocksPerAxis && level + 1 < levels_.size()) {
    ++level;
    x0 /= 2;
    x1 /= 2;
    y0 /= 2;
    y1 /= 2;
  }
  const Level& blocks = levels_[level];
  if (blocks.blocks.empty()) return std::nullopt;
  for (int y = y0; y <= y1; ++y) {
    const BlockRange* const row = &blocks.At(x0, y);
    for (int x = 0; x <= x1 - x0; ++x) range.Add(row[x]);
  }
  return range;
}

}  // namespace terrace::dem
