#include "engine/dem/crs/undulation_ranges.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The table has a range for 64 of its pixels: here for 8 nodes along a side.
constexpr int kPixelsPerNode = 8;

// A margin for rounding in other computations of positions, in steps of the grid.
constexpr double kSlack = 1e-6;

struct IndexRange {
  int first = 0, last = -1;

  bool is_empty() const { return first > last; }
};

// The nodes around positions from .. to, of `count`.
IndexRange Around(double from, double to, int count) {
  return {static_cast<int>(std::max(std::floor(from - kSlack), 0.0)),
          static_cast<int>(std::min(std::floor(to + kSlack) + 1, count - 1.0))};
}

}  // namespace

Result<UndulationRanges> UndulationRanges::Of(const UndulationGrid& grid, const Footprint& area) {
  UndulationRanges ranges(grid);
  ranges.whole_ = {kInfinity, -kInfinity};
  const double north = grid.RowOf(area.north), south = grid.RowOf(area.south);
  const IndexRange rows = Around(north, south, grid.rows());
  const double start = grid.ColumnOf(area.west), extent = (area.east - area.west) / grid.column_step();
  IndexRange columns{grid.columns(), -1};
  bool holds_longitudes = grid.wraps();
  for (const int turn : {-1, 0, 1}) {
    const double from = start + turn * 360 / grid.column_step();
    const IndexRange here = Around(from, from + extent, grid.columns());
    if (here.is_empty()) continue;
    columns = {std::min(columns.first, here.first), std::max(columns.last, here.last)};
    holds_longitudes |= from >= -kSlack && from + extent <= grid.columns() - 1 + kSlack;
  }
  if (rows.is_empty() || columns.is_empty()) return ranges;
  const int width = columns.last - columns.first + 1, height = rows.last - rows.first + 1;
  ranges.first_column_ = columns.first;
  ranges.first_row_ = rows.first;
  ranges.table_ = RangeTable(kPixelsPerNode * width, kPixelsPerNode * height);
  const int strip = std::max(1, (1 << 18) / width);
  for (int row = 0; row < height; row += strip) {
    const int count = std::min(strip, height - row);
    const auto heights = grid.Read(columns.first, rows.first + row, width, count);
    if (!heights) return tl::unexpected(heights.error());
    ranges.table_.AddWindow(0, row, width, count, heights->data(), kPixelsPerNode);
  }
  ranges.table_.Finish();
  const BlockRange all = ranges.table_.Whole();
  if (all.min <= all.max) ranges.whole_ = {all.min, all.max};
  ranges.is_complete_ = !all.has_voids && holds_longitudes && north >= -kSlack && south <= grid.rows() - 1 + kSlack;
  return ranges;
}

HeightRange UndulationRanges::Query(double west, double south, double width, double height) const {
  HeightRange range{kInfinity, -kInfinity};
  if (!(whole_.min <= whole_.max)) return range;
  const IndexRange rows = Around(grid_->RowOf(south + height), grid_->RowOf(south), grid_->rows());
  const double start = grid_->ColumnOf(west);
  for (const int turn : {-1, 0, 1}) {
    const double from = start + turn * 360 / grid_->column_step();
    const IndexRange columns = Around(from, from + width / grid_->column_step(), grid_->columns());
    if (columns.is_empty() || rows.is_empty()) continue;
    const auto pixel = [](int node, int first) { return static_cast<double>(kPixelsPerNode) * (node - first); };
    const BlockRange found = table_.Query(pixel(columns.first, first_column_), pixel(rows.first, first_row_),
                                          pixel(columns.last, first_column_), pixel(rows.last, first_row_));
    if (!(found.min <= found.max)) continue;
    range = {std::min(range.min, double{found.min}), std::max(range.max, double{found.max})};
  }
  return range;
}

}  // namespace terrace::dem
