#include "engine/dem/node_positions.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrace::dem {
namespace {

constexpr int kCellNodes = 32;  // grids have a multiple of it, so cells never cross the antimeridian or a pole

// A square of `size` x `size` nodes; it owns the nodes on its western and southern edges.
struct Cell {
  std::int64_t column, row;
  int size;
};

// Quadratic Lagrange weights on nodes -1, 0, 1.
std::array<double, 3> Weights(double step, int size) {
  const double t = 2 * step / size - 1;
  return {t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2};
}

// Centres of a lattice's cells, each counted as the node at its south-western corner.
struct CellCentres {
  explicit CellCentres(const geo::Lattice& lattice) : halves{lattice.level, 2 * lattice.cells} {}

  double Longitude(std::int64_t column) const { return halves.Longitude(2 * column + 1); }
  double Latitude(std::int64_t row) const { return halves.Latitude(2 * row + 1); }
  double StepDegrees() const { return 2 * halves.StepDegrees(); }
  std::int64_t rows() const { return halves.rows() / 2; }

  geo::Lattice halves;
};

// Pole rows, and what lies beyond them, are one position each; Web Mercator and the centres of cells have none.
bool IsPoleRow(const geo::Lattice& lattice, std::int64_t row) { return row <= 0 || row >= lattice.rows(); }
bool IsPoleRow(const geo::MercatorGrid&, std::int64_t) { return false; }
bool IsPoleRow(const CellCentres&, std::int64_t) { return false; }

template <typename Grid>
class GridNodes {
 public:
  GridNodes(const Georeference& georeference, const Footprint& footprint, const Grid& grid, const NodeWindow& window,
            double tolerance)
      : georeference_(georeference),
        footprint_(footprint),
        grid_(grid),
        window_(window),
        tolerance_(tolerance),
        positions_(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows), kNowhere) {}

  std::vector<Position> Compute() && {
    if (georeference_.is_affine()) {
      FillExactly(window_.column, window_.row, window_.columns, window_.rows);
    } else {
      const std::int64_t last_row = std::min(window_.row + window_.rows - 1, grid_.rows() - 1);
      const std::int64_t east = window_.column + window_.columns;
      for (std::int64_t row = FloorCell(std::max<std::int64_t>(window_.row, 0)); row <= last_row; row += kCellNodes) {
        for (std::int64_t column = FloorCell(window_.column); column < east; column += kCellNodes) {
          Fill({column, row, kCellNodes});
        }
      }
    }
    FillPoleRows();
    return std::move(positions_);
  }

 private:
  static std::int64_t FloorCell(std::int64_t node) { return node - (node % kCellNodes + kCellNodes) % kCellNodes; }

  Position Degrees(std::int64_t column, std::int64_t row) const {
    return {grid_.Longitude(column), grid_.Latitude(row)};
  }
  Position* At(std::int64_t column, std::int64_t row) {
    return &positions_[static_cast<std::size_t>((row - window_.row) * window_.columns + (column - window_.column))];
  }

  // Part of a cell inside the tile's window, as ranges of columns and rows (end exclusive).
  struct Part {
    std::int64_t west, south, east, north;
    bool empty() const { return west >= east || south >= north; }
  };
  Part Inside(const Cell& cell) const {
    return {std::max(cell.column, window_.column), std::max(cell.row, window_.row),
            std::min(cell.column + cell.size, window_.column + window_.columns),
            std::min(cell.row + cell.size, window_.row + window_.rows)};
  }

  void FillExactly(std::int64_t column, std::int64_t row, std::int64_t columns, std::int64_t rows) {
    for (std::int64_t r = row; r < row + rows; ++r) {
      for (std::int64_t c = column; c < column + columns; ++c) *At(c, r) = Degrees(c, r);
      georeference_.ToPixels({At(column, r), static_cast<std::size_t>(columns)});
    }
  }

  bool Touches(const Cell& cell) const {
    const auto [south, north] = std::minmax({grid_.Latitude(cell.row), grid_.Latitude(cell.row + cell.size)});
    return footprint_.Touches(grid_.Longitude(cell.column), south, cell.size * grid_.StepDegrees(), north - south);
  }

  void Fill(const Cell& cell) {
    const Part part = Inside(cell);
    if (part.empty() || !Touches(cell)) return;
    if (cell.size <= 2) {
      FillExactly(part.west, part.south, part.east - part.west, part.north - part.south);
    } else if (!Interpolate(cell, part)) {
      const int half = cell.size / 2;
      Fill({cell.column, cell.row, half});
      Fill({cell.column + half, cell.row, half});
      Fill({cell.column, cell.row + half, half});
      Fill({cell.column + half, cell.row + half, half});
    }
  }

  bool Interpolate(const Cell& cell, const Part& part) {
    // Nine nodes to interpolate from; two where the error of a cubic in one of the axes is near its largest.
    const int half = cell.size / 2, quarter = cell.size / 4;
    std::array<Position, 11> known;
    for (int i = 0; i < 9; ++i) {
      known[static_cast<std::size_t>(i)] = Degrees(cell.column + i % 3 * half, cell.row + i / 3 * half);
    }
    known[9] = Degrees(cell.column + quarter, cell.row + half);
    known[10] = Degrees(cell.column + half, cell.row + quarter);
    georeference_.ToPixels(known);
    if (std::ranges::any_of(known, [](const Position& p) { return std::isnan(p.x); })) return false;
    const auto at = [&](std::int64_t column, std::int64_t row) {
      const auto x = Weights(static_cast<double>(column - cell.column), cell.size);
      const auto y = Weights(static_cast<double>(row - cell.row), cell.size);
      Position sum;
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t i = 0; i < 3; ++i) {
          sum.x += x[i] * y[j] * known[3 * j + i].x;
          sum.y += x[i] * y[j] * known[3 * j + i].y;
        }
      }
      return sum;
    };
    const auto close = [&](const Position& a, const Position& b) {
      return std::abs(a.x - b.x) <= tolerance_ && std::abs(a.y - b.y) <= tolerance_;
    };
    if (!close(at(cell.column + quarter, cell.row + half), known[9]) ||
        !close(at(cell.column + half, cell.row + quarter), known[10])) {
      return false;
    }
    for (std::int64_t row = part.south; row < part.north; ++row) {
      for (std::int64_t column = part.west; column < part.east; ++column) *At(column, row) = at(column, row);
    }
    return true;
  }

  void FillPoleRows() {
    for (std::int64_t row = window_.row; row < window_.row + window_.rows; ++row) {
      if (!IsPoleRow(grid_, row)) continue;
      Position pole{0, grid_.Latitude(row)};
      georeference_.ToPixels({&pole, 1});
      std::fill_n(At(window_.column, row), window_.columns, pole);
    }
  }

  const Georeference& georeference_;
  const Footprint& footprint_;
  const Grid grid_;
  const NodeWindow window_;
  const double tolerance_;
  std::vector<Position> positions_;
};

}  // namespace

NodeWindow WindowOfTile(const geo::Lattice& lattice, const geo::TileKey& key) {
  return {lattice.FirstColumn(key) - 1, lattice.FirstRow(key) - 1, lattice.cells + 3, lattice.cells + 3};
}

std::vector<Position> NodePositions(const Georeference& georeference, const Footprint& footprint,
                                    const geo::Lattice& lattice, const NodeWindow& window, double tolerance) {
  return GridNodes(georeference, footprint, lattice, window, tolerance).Compute();
}

std::vector<Position> NodePositions(const Georeference& georeference, const Footprint& footprint,
                                    const geo::MercatorGrid& grid, const NodeWindow& window, double tolerance) {
  return GridNodes(georeference, footprint, grid, window, tolerance).Compute();
}

std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance) {
  const NodeWindow window{lattice.FirstColumn(key), lattice.FirstRow(key), lattice.cells, lattice.cells};
  return GridNodes(georeference, footprint, CellCentres(lattice), window, tolerance).Compute();
}

}  // namespace terrace::dem
