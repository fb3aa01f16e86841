// Bilinear interpolation on the grid of a factor: cells of four samples, the window that holds them, heights in them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/crs/projector.h"
#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// Four samples of the grid around a position, and how far it is from the first to the next, 0..1.
struct GridCell {
  std::int64_t column = 0, row = 0;
  double x = 0, y = 0;
};

// Finds cells of positions in source pixels, which come row by row, `stride` to a row. Those a little outside `width`
// by `height` count as on the edge. Where meridians are the raster's columns and parallels its rows, a position shares
// its x with the one above and its y with the one before: nothing is to be found anew.
class CellFinder {
 public:
  CellFinder(const GridAxis& columns, const GridAxis& rows, int width, int height, std::size_t stride)
      : columns_(columns), rows_(rows), width_(width), height_(height), above_(stride) {}

  // `index`: of the position, counted from the window's first.
  GridCell At(const Position& position, std::size_t index);

 private:
  struct Found {
    double position = std::numeric_limits<double>::quiet_NaN();  // equal to none
    GridAxis::Location place{};
  };

  const GridAxis columns_, rows_;
  const int width_, height_;
  std::vector<Found> above_;  // by column of the window
  Found row_;
};

// The smallest window with every cell, its columns counted from near one of them where the axis wraps. Moves the cells
// there. Precondition: not empty.
GridWindow WindowOf(std::span<GridCell> cells, const GridAxis& columns, const GridAxis& rows);

// Bilinear, weights renormalized over valid samples; nothing where there is none.
std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether one of the four samples that count is valid.
bool HasSample(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

// Whether the nearest of the four samples is valid.
bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell);

}  // namespace terrace::dem
