#include "engine/dem/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

float SampleAt(const std::vector<float>& heights, const GridWindow& window, std::int64_t column, std::int64_t row) {
  return heights[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
}

}  // namespace

GridCell CellAt(const Position& position, const GridAxis& columns, const GridAxis& rows, int width, int height) {
  const double x = columns.wraps() ? position.x : std::clamp(position.x, 0.0, static_cast<double>(width));
  const GridAxis::Place column = columns.Locate(x);
  const GridAxis::Place row = rows.Locate(std::clamp(position.y, 0.0, static_cast<double>(height)));
  return {column.index, row.index, column.weight, row.weight};
}

GridWindow WindowOf(std::span<GridCell> cells, const GridAxis& columns, const GridAxis& rows) {
  const std::int64_t around = cells[cells.size() / 2].column, turn = columns.count();
  std::int64_t west = std::numeric_limits<std::int64_t>::max(), east = std::numeric_limits<std::int64_t>::min();
  std::int64_t north = west, south = east;
  for (GridCell& cell : cells) {
    if (columns.wraps()) {
      if (cell.column - around > turn / 2) cell.column -= turn;
      if (around - cell.column > turn / 2) cell.column += turn;
    }
    west = std::min(west, cell.column);
    east = std::max(east, cell.column + 1);
    north = std::min(north, cell.row);
    south = std::max(south, cell.row + 1);
  }
  if (!columns.wraps()) east = std::min(east, columns.count() - 1);
  south = std::min(south, rows.count() - 1);
  return {west, north, east - west + 1, south - north + 1};
}

std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  double sum = 0, weights = 0;
  const auto add = [&](std::int64_t dx, std::int64_t dy, double weight) {
    if (weight <= 0) return;
    const float height = SampleAt(heights, window, cell.column + dx, cell.row + dy);
    if (std::isnan(height)) return;
    sum += weight * height;
    weights += weight;
  };
  add(0, 0, (1 - cell.x) * (1 - cell.y));
  add(1, 0, cell.x * (1 - cell.y));
  add(0, 1, (1 - cell.x) * cell.y);
  add(1, 1, cell.x * cell.y);
  if (weights == 0) return std::nullopt;
  return sum / weights;
}

bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  return !std::isnan(
      SampleAt(heights, window, cell.column + (cell.x >= 0.5 ? 1 : 0), cell.row + (cell.y >= 0.5 ? 1 : 0)));
}

}  // namespace terrace::dem
