// Bilinear interpolation on the grid of averages by a factor: cells of four samples, the window that contains them, and
// heights in them.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/crs/node_positions.h"
#include "engine/raster/raster_layout.h"

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
  GridAxis columns{1, 1, false}, rows{1, 1, false};
  int width = 0, height = 0;

  // Positions are in source pixels. Positions outside the raster are clamped to its edge, except columns that wrap.
  // Precondition: not NaN.
  GridAxis::Location Column(double x) const;
  GridAxis::Location Row(double y) const;
  GridCell CellAt(const Position& position) const;
};

// The cells of a window's nodes. They are located on the axes if positions are separable, else on demand.
class NodeCells {
 public:
  NodeCells() = default;
  NodeCells(NodePositions positions, const GridAxes& axes);

  const NodePositions& positions() const { return positions_; }
  const GridAxes& axes() const { return axes_; }
  const NodeWindow& window() const { return positions_.window(); }
  bool is_separable() const { return positions_.is_separable(); }
  // Locations of the window's columns and rows. Precondition: is_separable().
  std::span<const GridAxis::Location> columns() const { return columns_; }
  std::span<const GridAxis::Location> rows() const { return rows_; }

  // Precondition: the node has a position.
  GridCell At(std::size_t i, std::size_t j) const;
  // The cell of the node at a global column and row inside the window.
  GridCell OfNode(std::int64_t column, std::int64_t row) const {
    return At(static_cast<std::size_t>(column - window().column), static_cast<std::size_t>(row - window().row));
  }

  // Returns the smallest window of averages with the cells of the nodes that are `wanted`, one entry per node. Where
  // columns wrap, moves all cells to within half a turn of the one in the middle. Precondition: a node is wanted, and
  // those that are have a position.
  // `are_all`: all nodes are wanted.
  GridWindow MoveIntoWindow(std::span<const std::uint8_t> wanted, bool are_all = false);
  // Moves cells to within half a turn of a column.
  void MoveNear(std::int64_t column);

 private:
  GridWindow WindowOfNodes(std::span<const std::uint8_t> wanted, bool are_all) const;

  NodePositions positions_;
  GridAxes axes_;
  std::vector<GridAxis::Location> columns_, rows_;  // if separable
  std::optional<std::int64_t> near_;                // column that cells were moved to, unless separable
};

// Moves cells to columns near one of them if the axis wraps, and returns WindowOf them. Precondition: not empty.
GridWindow MoveTogether(std::span<GridCell> cells, const GridAxes& axes);
// Returns the smallest window that contains all cells.
GridWindow WindowOf(std::span<const GridCell> cells, const GridAxes& axes);

// Interpolates bilinearly, with weights renormalized over valid samples; nothing if there is none.
std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether one of the four samples has a nonzero weight and is valid.
bool HasSample(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether the nearest of the four samples is valid.
bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

}  // namespace terrace::dem
