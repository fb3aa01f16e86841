#include "engine/dem/raster/grid_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

float SampleAt(const std::vector<float>& heights, const GridWindow& window, std::int64_t column, std::int64_t row) {
  return heights[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
}

double Between(double first, double second, double weight) { return first + weight * (second - first); }

// Moves a column by a turn, if needed, to within half a turn of `around`.
std::int64_t NearestTurn(std::int64_t column, std::int64_t around, const GridAxis& columns) {
  if (!columns.wraps()) return column;
  const std::int64_t turn = columns.count();
  if (column - around > turn / 2) column -= turn;
  if (around - column > turn / 2) column += turn;
  return column;
}

// The columns and rows of cells.
class CellHull {
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

NodeCells::NodeCells(const NodePositions& positions, const GridAxes& axes, std::span<const std::uint8_t> inside)
    : window_(positions.window()) {
  if (positions.is_separable()) {
    for (const double x : positions.x()) columns_.push_back(axes.Column(x));
    for (const double y : positions.y()) rows_.push_back(axes.Row(y));
    return;
  }
  const std::span<const Position> nodes = positions.nodes();
  cells_.resize(nodes.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (inside[n] != 0) cells_[n] = axes.CellAt(nodes[n]);
  }
}

void NodeCells::MoveNear(std::int64_t column, const GridAxis& columns) {
  if (!columns.wraps()) return;
  for (GridAxis::Location& place : columns_) place.index = NearestTurn(place.index, column, columns);
  for (GridCell& cell : cells_) cell.column = NearestTurn(cell.column, column, columns);
}

GridWindow NodeCells::MoveIntoWindow(const GridAxes& axes, std::span<const std::uint8_t> wanted) {
  const auto stride = static_cast<std::size_t>(window_.columns);
  if (axes.columns.wraps()) {
    // The middle column, so that columns over half a turn stay in order; else the column of the nearest requested node.
    std::size_t nearest = wanted.size();
    const auto distance = [&](std::size_t n) { return std::abs(static_cast<std::ptrdiff_t>(n % stride - stride / 2)); };
    for (std::size_t n = 0; n < wanted.size() && !is_separable(); ++n) {
      if (wanted[n] != 0 && (nearest == wanted.size() || distance(n) < distance(nearest))) nearest = n;
    }
    MoveNear(is_separable() ? columns_[stride / 2].index : cells_[nearest].column, axes.columns);
  }
  CellHull hull;
  if (!is_separable()) {
    for (std::size_t n = 0; n < cells_.size(); ++n) {
      if (wanted[n] == 0) continue;
      hull.AddColumn(cells_[n].column);
      hull.AddRow(cells_[n].row);
    }
    return hull.Window(axes);
  }
  std::vector<std::uint8_t> of_column(stride);
  for (std::size_t j = 0; j < rows_.size(); ++j) {
    std::uint8_t of_row = 0;
    for (std::size_t i = 0; i < stride; ++i) {
      of_row |= wanted[j * stride + i];
      of_column[i] |= wanted[j * stride + i];
    }
    if (of_row != 0) hull.AddRow(rows_[j].index);
  }
  for (std::size_t i = 0; i < stride; ++i) {
    if (of_column[i] != 0) hull.AddColumn(columns_[i].index);
  }
  return hull.Window(axes);
}

GridWindow WindowOf(std::span<GridCell> cells, const GridAxes& axes) {
  const std::int64_t around = cells[cells.size() / 2].column;
  for (GridCell& cell : cells) cell.column = NearestTurn(cell.column, around, axes.columns);
  return HullOf(cells, axes);
}

GridWindow HullOf(std::span<const GridCell> cells, const GridAxes& axes) {
  CellHull hull;
  for (const GridCell& cell : cells) {
    hull.AddColumn(cell.column);
    hull.AddRow(cell.row);
  }
  return hull.Window(axes);
}

std::optional<double> Interpolate(const std::vector<float>& heights, const GridWindow& window, const GridCell& cell) {
  // Samples with weight 0 may lie outside the window.
  const std::int64_t dx = cell.x > 0 ? 1 : 0, dy = cell.y > 0 ? 1 : 0;
  const double height = Between(Between(SampleAt(heights, window, cell.column, cell.row),
                                        SampleAt(heights, window, cell.column + dx, cell.row), cell.x),
                                Between(SampleAt(heights, window, cell.column, cell.row + dy),
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

NodeRows::NodeRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells,
                   std::size_t first, std::size_t end)
    : samples_(samples), window_(window), cells_(cells), heights_(end - first) {
  for (const GridAxis::Location& place : cells.columns().subspan(first, end - first)) {
    // Columns of nodes that are not requested may lie outside.
    const std::int64_t last = window.columns - 1, west = std::clamp<std::int64_t>(place.index - window.column, 0, last);
    west_.push_back(static_cast<std::int32_t>(west));
    east_.push_back(static_cast<std::int32_t>(std::min(west + (place.weight > 0 ? 1 : 0), last)));
    weights_.push_back(place.weight);
  }
  for (Line& line : lines_) line.heights.resize(heights_.size());
}

const NodeRows::Line& NodeRows::LineOf(std::int64_t row) {
  Line& line = lines_[static_cast<std::size_t>(row % 2)];
  if (line.row == row) return line;
  line.row = row;
  const float* const samples = samples_.data() + (row - window_.row) * window_.columns;
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    line.heights[i] = Between(samples[west_[i]], samples[east_[i]], weights_[i]);
  }
  return line;
}

std::span<const double> NodeRows::Row(std::size_t j) {
  const GridAxis::Location& place = cells_.rows()[j];
  const Line& north = LineOf(place.index);
  if (place.weight <= 0) return north.heights;
  const Line& south = LineOf(place.index + 1);
  for (std::size_t i = 0; i < heights_.size(); ++i) {
    heights_[i] = Between(north.heights[i], south.heights[i], place.weight);
  }
  return heights_;
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
