// The cells of a tile in which a replacement may have voids: averages hide voids between nodes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/dem_impl.h"
#include "engine/mosaic/window_values.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {
namespace {

// The averages between which the corners of a cell of nodes lie. Nothing if a corner has no position.
std::optional<GridWindow> SamplesAround(const NodeCells& nodes, std::size_t i, std::size_t j) {
  std::array<GridCell, 4> corners;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const std::size_t column = i + k % 2, row = j + k / 2;
    const Position at = nodes.positions().At(column, row);
    if (!std::isfinite(at.x) || !std::isfinite(at.y)) return std::nullopt;
    corners[k] = nodes.At(column, row);
  }
  return WindowOf(corners, nodes.axes());
}

bool Contains(const GridWindow& window, const GridWindow& other) {
  return other.column >= window.column && other.column + other.columns <= window.column + window.columns &&
         other.row >= window.row && other.row + other.rows <= window.row + window.rows;
}

}  // namespace

std::vector<std::uint8_t> ElevationModel::Impl::VoidCells(const geo::Lattice& lattice, const NodeWindow& window,
                                                          std::span<const PartReading> readings) const {
  const std::vector<std::size_t> order = GridsAt(BoxOf(lattice, window));
  const auto columns = static_cast<std::size_t>(window.columns - 1), rows = static_cast<std::size_t>(window.rows - 1);
  std::vector<std::uint8_t> cells(columns * rows, 1);
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const GridReading& reading = readings[k].reading;
    if (readings[k].part || reading.window.columns == 0) continue;
    const RasterGrid& grid = grids[order[k]];
    const bool has_voids = grid.Ranges(PixelsOf(reading.window, reading.factor)).has_voids;
    for (std::size_t cell = 0; cell < cells.size(); ++cell) {
      if (cells[cell] == 0) continue;
      const auto around = SamplesAround(reading.cells, cell % columns, cell / columns);
      if (!around) continue;
      const bool is_known = !has_voids && Contains(reading.window, *around);
      cells[cell] = !is_known && grid.Ranges(PixelsOf(*around, reading.factor)).has_voids ? 1 : 0;
    }
  }
  return cells;
}

}  // namespace terrace::dem
