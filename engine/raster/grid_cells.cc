#include "engine/raster/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::dem {
namespace {

float SampleAt(const std::vector<float>& heights, const GridWindow& window, std::int64_t column, std::int64_t row) {
  return heights[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
}

double Lerp(double first, double second, double weight) { return first + weight * (second - first); }

// Moves a column by a turn, if needed, to within half a turn of `around`.
std::int64_t NearestTurn(std::int64_t column, std::int64_t around, const GridAxis& columns) {
  if (!columns.wraps()) return column;
  const std::int64_t turn = columns.count();
  if (column - around > turn / 2) column -= turn;
  if (around - column > turn / 2) column += turn;
  return column;
}

// The columns and rows of cells.
class CellWindow {
 public:
  void AddColumn(std::int64_t column) { west_ = std::min(west_, column), east_ = std::max(east_, column + 1); }
  void AddRow(std::int64_t row) { north_ = std::min(north_, row), south_ = std::max(south_, row + 1); }

  GridWindow Window(const GridAxes& axes) const {
    const std::int64_t east = axes.columns.wraps() ? east_ : std::min(east_, axes.columns.count() - 1);
    const std::int64_t south = std::min(south_, axes.rows.count() - 1);
    return {west_, north_, east - west_ + 1, south - north_ + 1};
  }

 private:
  std::int64_t west_ = std::numeric_limits<std::int64_t>::max(), east_ = std::numeric_limits<std::int64_t>::min();
  std::int64_t north_ = west_, south_ = east_;
};

PositionExtent ExtentOfWanted(const NodePositions& positions, std::span<const std::uint8_t> wanted) {
  PositionExtent extent;
  const auto add = [&](const Position& min, const Position& max) {
    extent.min = {std::min(extent.min.x, min.x), std::min(extent.min.y, min.y)};
    extent.max = {std::max(extent.max.x, max.x), std::max(extent.max.y, max.y)};
  };
  for (std::size_t j = 0; j < positions.rows(); ++j) {
    const std::span<const Position> nodes = positions.Row(j);
    const std::span<const std::uint8_t> row = wanted.subspan(j * nodes.size(), nodes.size());
    if (std::ranges::find(row, std::uint8_t{0}) == row.end()) {
      const PositionExtent of_row = ExtentOf(nodes);
      add(of_row.min, of_row.max);
      continue;
    }
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (row[i] != 0) add(nodes[i], nodes[i]);
    }
  }
  return extent;
}

}  // namespace

GridAxis::Location GridAxes::Column(double x) const {
  return columns.Locate(columns.wraps() ? x : std::clamp(x, 0.0, static_cast<double>(width)));
}

GridAxis::Location GridAxes::Row(double y) const {
  return rows.Locate(std::clamp(y, 0.0, static_cast<double>(height)));
}

GridCell GridAxes::CellAt(const Position& position) const {
  const GridAxis::Location column = Column(position.x), row = Row(position.y);
  return {column.index, row.index, column.weight, row.weight};
}

NodeCells::NodeCells(NodePositions positions, const GridAxes& axes) : positions_(std::move(positions)), axes_(axes) {
  if (!is_separable()) return;
  for (const double x : positions_.x()) columns_.push_back(axes.Column(x));
  for (const double y : positions_.y()) rows_.push_back(axes.Row(y));
}

GridCell NodeCells::At(std::size_t i, std::size_t j) const {
  if (is_separable()) return {columns_[i].index, rows_[j].index, columns_[i].weight, rows_[j].weight};
  GridCell cell = axes_.CellAt(positions_.At(i, j));
  if (near_) cell.column = NearestTurn(cell.column, *near_, axes_.columns);
  return cell;
}

void NodeCells::MoveNear(std::int64_t column) {
  if (!axes_.columns.wraps()) return;
  if (!is_separable()) near_ = column;
  for (GridAxis::Location& place : columns_) place.index = NearestTurn(place.index, column, axes_.columns);
}

// Indices grow with positions, so without wrapping the outermost positions have the outermost cells.
GridWindow NodeCells::WindowOfNodes(std::span<const std::uint8_t> wanted, bool are_all) const {
  CellWindow window;
  if (!axes_.columns.wraps()) {
    const PositionExtent extent = are_all ? positions_.extent() : ExtentOfWanted(positions_, wanted);
    for (const Position& position : {extent.min, extent.max}) {
      const GridCell cell = axes_.CellAt(position);
      window.AddColumn(cell.column);
      window.AddRow(cell.row);
    }
    return window.Window(axes_);
  }
  for (std::size_t n = 0; n < wanted.size(); ++n) {
    if (wanted[n] == 0) continue;
    const GridCell cell = At(n % positions_.columns(), n / positions_.columns());
    window.AddColumn(cell.column);
    window.AddRow(cell.row);
  }
  return window.Window(axes_);
}

GridWindow NodeCells::MoveIntoWindow(std::span<const std::uint8_t> wanted, bool are_all) {
  const std::size_t stride = positions_.columns();
  if (axes_.columns.wraps()) {
    // The middle column, so that columns over half a turn stay in order; else the column of the nearest requested node.
    std::size_t nearest = wanted.size();
    const auto distance = [&](std::size_t n) { return std::abs(static_cast<std::ptrdiff_t>(n % stride - stride / 2)); };
    for (std::size_t n = 0; n < wanted.size() && !is_separable(); ++n) {
      if (wanted[n] != 0 && (nearest == wanted.size() || distance(n) < distance(nearest))) nearest = n;
    }
    MoveNear(is_separable() ? columns_[stride / 2].index : At(nearest % stride, nearest / stride).column);
  }
  if (!is_separable()) return WindowOfNodes(wanted, are_all);
  CellWindow window;
  std::vector<std::uint8_t> of_column(stride, are_all ? 1 : 0);
  for (std::size_t j = 0; j < rows_.size(); ++j) {
    if (are_all) {
      window.AddRow(rows_[j].index);
      continue;
    }
    std::uint8_t of_row = 0;
    for (std::size_t i = 0; i < stride; ++i) {
      of_row |= wanted[j * stride + i];
      of_column[i] |= wanted[j * stride + i];
    }
    if (of_row != 0) window.AddRow(rows_[j].index);
  }
  for (std::size_t i = 0; i < stride; ++i) {
    if (of_column[i] != 0) window.AddColumn(columns_[i].index);
  }
  return window.Window(axes_);
}

GridWindow MoveTogether(std::span<GridCell> cells, const GridAxes& axes) {
  const std::int64_t around = cells[cells.size() / 2].column;
  for (GridCell& cell : cells) cell.column = NearestTurn(cell.column, around, axes.columns);
  return WindowOf(cells, axes);
}

GridWindow WindowOf(std::span<const GridCell> cells, const GridAxes& axes) {
  CellWindow window;
  for (const GridCell& cell : cells) {
    window.AddColumn(cell.column);
    window.AddRow(cell.row);
  }
  return window.Window(axes);
}

std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  // Samples with weight 0 may lie outside the window.
  const std::int64_t dx = cell.x > 0 ? 1 : 0, dy = cell.y > 0 ? 1 : 0;
  const double height = Lerp(Lerp(SampleAt(heights, window, cell.column, cell.row),
                                  SampleAt(heights, window, cell.column + dx, cell.row), cell.x),
                             Lerp(SampleAt(heights, window, cell.column, cell.row + dy),
                                  SampleAt(heights, window, cell.column + dx, cell.row + dy), cell.x),
                             cell.y);
  if (!std::isnan(height)) return height;
  double sum = 0, weights = 0;
  const auto add = [&](std::int64_t x, std::int64_t y, double weight) {
    if (weight <= 0) return;
    const float sample = SampleAt(heights, window, cell.column + x, cell.row + y);
    if (std::isnan(sample)) return;
    sum += weight * sample;
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
