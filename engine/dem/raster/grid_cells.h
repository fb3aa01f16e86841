// Bilinear interpolation on the grid of a factor: cells of four samples, the window that holds them, heights in them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/crs/node_positions.h"
#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// Heights are multiples of 2^-10 m: libm's last bits, which differ between processors, end here. Halves go to the even
// multiple. Precondition: below 2^42 m.
inline float RoundHeight(double metres) {
  // std::nearbyint without a call, so that loops become vectors: at 2^52 a double has no bits below one.
  constexpr double kNoFraction = 0x1p52;
  const double scaled = metres * 1024;
  return static_cast<float>(std::copysign((std::abs(scaled) + kNoFraction) - kNoFraction, scaled) / 1024);
}

// Four samples of the grid around a position, and how far it is from the first to the next, 0..1.
struct GridCell {
  std::int64_t column = 0, row = 0;
  double x = 0, y = 0;
};

// The grid of a factor, and the size of the raster in pixels.
struct GridAxes {
  GridAxis columns, rows;
  int width = 0, height = 0;

  // Positions are in source pixels. Those outside the raster count as on its edge, but for columns that wrap.
  // Precondition: not NaN.
  GridAxis::Location Column(double x) const;
  GridAxis::Location Row(double y) const;
  GridCell CellAt(const Position& position) const;
};

// The cells of a window's nodes. Where positions are separable, nothing is stored per node.
class NodeCells {
 public:
  NodeCells() = default;
  // Nodes have cells where `inside`, one entry per node, is not 0.
  NodeCells(const NodePositions& positions, const GridAxes& axes, std::span<const std::uint8_t> inside);

  const NodeWindow& window() const { return window_; }
  bool is_separable() const { return cells_.empty(); }
  // Of the window's columns and rows. Precondition: is_separable().
  std::span<const GridAxis::Location> columns() const { return columns_; }
  std::span<const GridAxis::Location> rows() const { return rows_; }

  GridCell At(std::size_t i, std::size_t j) const {
    if (!is_separable()) return cells_[j * static_cast<std::size_t>(window_.columns) + i];
    return {columns_[i].index, rows_[j].index, columns_[i].weight, rows_[j].weight};
  }
  // By a node's global column and row, inside the window.
  GridCell OfNode(std::int64_t column, std::int64_t row) const {
    return At(static_cast<std::size_t>(column - window_.column), static_cast<std::size_t>(row - window_.row));
  }

  // Returns the smallest window of averages with the cells of the nodes that are `wanted`, one entry per node. Where
  // columns wrap, moves all cells to within half a turn of the one in the middle. Precondition: a node is wanted, and
  // those that are have a cell.
  GridWindow MoveIntoWindow(const GridAxes& axes, std::span<const std::uint8_t> wanted);
  // Moves cells to within half a turn of a column.
  void MoveNear(std::int64_t column, const GridAxis& columns);

 private:
  NodeWindow window_;
  std::vector<GridAxis::Location> columns_, rows_;
  std::vector<GridCell> cells_;
};

// The smallest window with every cell, its columns counted from near one of them where the axis wraps. Moves the cells
// there. Precondition: not empty.
GridWindow WindowOf(std::span<GridCell> cells, const GridAxes& axes);
// The same with cells as they are.
GridWindow HullOf(std::span<const GridCell> cells, const GridAxes& axes);

// Bilinear, weights renormalized over valid samples; nothing where there is none.
std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Heights along rows of nodes between the samples of a window, where cells are separable. Bit for bit what Interpolate
// gives.
class NodeRows {
 public:
  // Nodes `first` to `end` of each row. What these refer to outlives it. Precondition: `cells` are separable.
  NodeRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells, std::size_t first,
           std::size_t end);

  // One height per node from `first` on; NaN where a sample that counts is void, of no meaning where the node's column
  // lies outside the window. Valid until the next call. Precondition: the row's cells lie in the window's rows.
  std::span<const double> Row(std::size_t j);

 private:
  struct Line {
    std::int64_t row = -1;  // of the samples between which the heights are interpolated
    std::vector<double> heights;
  };

  const Line& LineOf(std::int64_t row);

  const std::vector<float>& samples_;
  const GridWindow window_;
  const NodeCells& cells_;
  std::vector<std::int32_t> west_, east_;  // by node, the columns of its samples in the window
  std::vector<double> weights_;            // of the eastern ones
  std::array<Line, 2> lines_;
  std::vector<double> heights_;
};

// Whether one of the four samples that count is valid.
bool HasSample(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether the nearest of the four samples is valid.
bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

}  // namespace terrace::dem
