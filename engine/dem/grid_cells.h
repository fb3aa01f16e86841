// Interpolation in the averaged grid of a source (sample_grid.h): which four samples a position lies between, the
// window that holds those of many positions, and the value there.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/dem/projector.h"
#include "engine/dem/sample_grid.h"

namespace terrace::dem {

// Four samples of the grid around a node, and how far it is from the first to the next.
struct Cell {
  std::int64_t column, row;
  double x, y;
};

// `position` in source pixels; `width` and `height` of the raster, beyond which its outermost samples go on.
Cell CellAt(const Position& position, const GridAxis& columns, const GridAxis& rows, int width, int height);

// The smallest window with every cell, its columns counted from near one of them where the axis wraps. Moves the cells
// there. Precondition: there is a cell.
GridWindow WindowOf(std::vector<Cell>& cells, const GridAxis& columns, const GridAxis& rows);

// Bilinear, weights renormalized over valid samples; nothing where there is none.
std::optional<double> Interpolate(const std::vector<float>& samples, const GridWindow& window, const Cell& cell);

}  // namespace terrace::dem
