// Bilinear interpolation on the grid of a factor: cells of four samples, the window that holds them, heights in them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/projector.h"
#include "engine/dem/sample_grid.h"

namespace terrace::dem {

// Four samples of the grid around a position, and how far it is from the first to the next, 0..1.
struct GridCell {
  std::int64_t column = 0, row = 0;
  double x = 0, y = 0;
};

// Positions in source pixels; those a little outside `width` by `height` count as on the edge.
GridCell CellAt(const Position& position, const GridAxis& columns, const GridAxis& rows, int width, int height);

// The smallest window with every cell, its columns counted from near one of them where the axis wraps. Moves the cells
// there. Precondition: not empty.
GridWindow WindowOf(std::span<GridCell> cells, const GridAxis& columns, const GridAxis& rows);

// Bilinear, weights renormalized over valid samples; nothing where there is none.
std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether the nearest of the four samples is valid.
bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

}  // namespace terrace::dem
