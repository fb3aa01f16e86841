#include "engine/dem/raster/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

float SampleAt(const std::vector<float>& heights, const GridWindow& window, std::int64_t column, std::int64_t row) {
  return heights[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
}

}  // namespace

GridCell CellFinder::At(const Position& position, std::size_t index) {
  Found& column = above_[index % above_.size()];
  if (column.position != position.x) {
    const double x = columns_.wraps() ? position.x : std::clamp(position.x, 0.0, static_cast<double>(width_));
    column = {position.x, columns_.Locate(x)};
  }
  if (row_.position != position.y) {
    row_ = {position.y, rows_.Locate(std::clamp(position.y, 0.0, static_cast<double>(height_)))};
  }
  return {column.place.index, row_.place.index, column.place.weight, row_.place.weight};
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
  if (cell.x > 0 && cell.y > 0 && cell.x < 1 && cell.y < 1) {
    // Four samples that count, as nearly everywhere. In the order of what follows: the same bits.
    const float* const north =
        &heights[static_cast<std::size_t>((cell.row - window.row) * window.columns + cell.column - window.column)];
    const float* const south = north + window.columns;
    const double nw = (1 - cell.x) * (1 - cell.y), ne = cell.x * (1 - cell.y);
    const double sw = (1 - cell.x) * cell.y, se = cell.x * cell.y;
    sum = sum + nw * north[0] + ne * north[1] + sw * south[0] + se * south[1];
    if (!std::isnan(sum) && nw > 0 && ne > 0 && sw > 0 && se > 0) return sum / (nw + ne + sw + se);
    sum = 0;
  }
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

bool HasSample(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  const auto has = [&](std::int64_t dx, std::int64_t dy, double weight) {
    return weight > 0 && !std::isnan(SampleAt(heights, window, cell.column + dx, cell.row + dy));
  };
  return has(0, 0, (1 - cell.x) * (1 - cell.y)) || has(1, 0, cell.x * (1 - cell.y)) ||
         has(0, 1, (1 - cell.x) * cell.y) || has(1, 1, cell.x * cell.y);
}

bool IsNearestValid(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  return !std::isnan(
      SampleAt(heights, window, cell.column + (cell.x >= 0.5 ? 1 : 0), cell.row + (cell.y >= 0.5 ? 1 : 0)));
}

}  // namespace terrace::dem
