// Bilinear interpolation on the grid of averages by a factor: cells of four samples, the window that contains them, and
// heights in them.
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

// Rounds to the nearest multiple of 2^-10 m, ties to even. This removes the last bits of libm's results, which differ
// between processors. Precondition: |metres| < 2^42.
inline float RoundHeight(double metres) {
  // Like std::nearbyint, but without a call, so that compilers can vectorize loops: at 2^52 a double has no fraction
  // bits.
  constexpr double kNoFraction = 0x1p52;
  const double scaled = metres * 1024;
  return static_cast<float>(std::copysign((std::abs(scaled) + kNoFraction) - kNoFraction, scaled) / 1024);
}

// The cell of four samples around a position, and the position's fraction of the way across it, 0 .. 1.
struct GridCell {
  std::int64_t column = 0, row = 0;
  double x = 0, y = 0;
};

// The axes of the grid of averages by a factor, and the size of the raster in pixels.
struct GridAxes {
  GridAxis columns, rows;
  int width = 0, height = 0;

  // Positions are in source pixels. Positions outside the raster are clamped to its edge, except columns that wrap.
  // Precondition: not NaN.
  GridAxis::Location Column(double x) const;
  GridAxis::Location Row(double y) const;
  GridCell CellAt(const Position& position) const;
};

// The cells of a window's nodes. If positions are separable, nothing is stored per node.
class NodeCells {
 public:
  NodeCells() = default;
  // Nodes have cells where `inside`, one entry per node, is not 0.
  NodeCells(const NodePositions& positions, const GridAxes& axes, std::span<const std::uint8_t> inside);

  const NodeWindow& window() const { return window_; }
  bool is_separable() const { return cells_.empty(); }
  // Locations of the window's columns and rows. Precondition: is_separable().
  std::span<const GridAxis::Location> columns() const { return columns_; }
  std::span<const GridAxis::Location> rows() const { return rows_; }

  GridCell At(std::size_t i, std::size_t j) const {
    if (!is_separable()) return cells_[j * static_cast<std::size_t>(window_.columns) + i];
    return {columns_[i].index, rows_[j].index, columns_[i].weight, rows_[j].weight};
  }
  // The cell of the node at a global column and row inside the window.
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

// Returns the smallest window that contains all cells. If the axis wraps, moves the cells to columns near one of them.
// Precondition: not empty.
GridWindow WindowOf(std::span<GridCell> cells, const GridAxes& axes);
// The same without moving the cells.
GridWindow HullOf(std::span<const GridCell> cells, const GridAxes& axes);

// Interpolates bilinearly, with weights renormalized over valid samples; nothing if there is none.
std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Interpolates along rows of nodes, for separable cells. Results are bit-equal to those of Interpolate.
class NodeRows {
 public:
  // For nodes `first` to `end` of each row. The arguments must outlive this object. Precondition: `cells` are
  // separable.
  NodeRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells, std::size_t first,
           std::size_t end);

  // Returns one height per node from `first` on; NaN if a sample with a nonzero weight is void; undefined if the node's
  // column lies outside the window. Valid until the next call. Precondition: the row's cells lie in the window's rows.
  std::span<const double> Row(std::size_t j);

 private:
  struct Line {
    std::int64_t row = -1;  // of samples
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

// Whether one of the four samples has a nonzero weight and is valid.
bool HasSample(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether the nearest of the four samples is valid.
bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

}  // namespace terrace::dem
