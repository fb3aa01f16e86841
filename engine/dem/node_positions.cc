#include "engine/dem/node_positions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

constexpr int kCellNodes = 32;  // lattices have a multiple of it, so cells never cross the antimeridian or a pole
constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();

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

// With a `halo` of 1: nodes. Without: centres of cells, each counted as the node at its south-western corner.
class TileNodes {
 public:
  TileNodes(const Georeference& georeference, const Footprint& footprint, const geo::Lattice& lattice,
            const geo::TileKey& key, double tolerance, int halo)
      : georeference_(georeference),
        footprint_(footprint),
        lattice_(lattice),
        halves_{lattice.level, 2 * lattice.cells},
        centres_(halo == 0),
        first_column_(lattice.FirstColumn(key) - halo),
        first_row_(lattice.FirstRow(key) - halo),
        stride_(halo == 0 ? lattice.cells : lattice.cells + 1 + 2 * halo),
        tolerance_(tolerance),
        positions_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(stride_),
                   Position{kNowhere, kNowhere}) {}

  std::vector<Position> Compute() && {
    if (georeference_.is_affine()) {
      FillExactly(first_column_, first_row_, stride_, stride_);
    } else {
      const std::int64_t last_row = std::min(first_row_ + stride_ - 1, lattice_.rows() - 1);
      for (std::int64_t row = FloorCell(std::max<std::int64_t>(first_row_, 0)); row <= last_row; row += kCellNodes) {
        for (std::int64_t column = FloorCell(first_column_); column < first_column_ + stride_; column += kCellNodes) {
          Fill({column, row, kCellNodes});
        }
      }
    }
    if (!centres_) FillPoleRows();
    return std::move(positions_);
  }

 private:
  static std::int64_t FloorCell(std::int64_t node) { return node - (node % kCellNodes + kCellNodes) % kCellNodes; }

  Position Degrees(std::int64_t column, std::int64_t row) const {
    return {lattice_.Longitude(column), lattice_.Latitude(row)};
  }
  Position CentreDegrees(std::int64_t column, std::int64_t row) const {
    return {halves_.Longitude(2 * column + 1), halves_.Latitude(2 * row + 1)};
  }
  Position* At(std::int64_t column, std::int64_t row) {
    return &positions_[static_cast<std::size_t>((row - first_row_) * stride_ + (column - first_column_))];
  }

  // Part of a cell inside the tile's window, as ranges of columns and rows (end exclusive).
  struct Part {
    std::int64_t west, south, east, north;
    bool empty() const { return west >= east || south >= north; }
  };
  Part Inside(const Cell& cell) const {
    return {std::max(cell.column, first_column_), std::max(cell.row, first_row_),
            std::min(cell.column + cell.size, first_column_ + stride_),
            std::min(cell.row + cell.size, first_row_ + stride_)};
  }

  void FillExactly(std::int64_t column, std::int64_t row, std::int64_t columns, std::int64_t rows) {
    for (std::int64_t r = row; r < row + rows; ++r) {
      for (std::int64_t c = column; c < column + columns; ++c)
        *At(c, r) = centres_ ? CentreDegrees(c, r) : Degrees(c, r);
      georeference_.ToPixels({At(column, r), static_cast<std::size_t>(columns)});
    }
  }

  void Fill(const Cell& cell) {
    const Part part = Inside(cell);
    const double extent = cell.size * lattice_.StepDegrees();
    if (part.empty() ||
        !footprint_.Touches(lattice_.Longitude(cell.column), lattice_.Latitude(cell.row), extent, extent)) {
      return;
    }
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
    const auto at = [&](std::int64_t column, std::int64_t row, double shift) {
      const auto x = Weights(static_cast<double>(column - cell.column) + shift, cell.size);
      const auto y = Weights(static_cast<double>(row - cell.row) + shift, cell.size);
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
    if (!close(at(cell.column + quarter, cell.row + half, 0), known[9]) ||
        !close(at(cell.column + half, cell.row + quarter, 0), known[10])) {
      return false;
    }
    const double shift = centres_ ? 0.5 : 0;
    for (std::int64_t row = part.south; row < part.north; ++row) {
      for (std::int64_t column = part.west; column < part.east; ++column) *At(column, row) = at(column, row, shift);
    }
    return true;
  }

  void FillPoleRows() {
    for (std::int64_t row = first_row_; row < first_row_ + stride_; ++row) {
      if (row > 0 && row < lattice_.rows()) continue;
      Position pole{0, lattice_.Latitude(row)};
      georeference_.ToPixels({&pole, 1});
      std::fill_n(At(first_column_, row), stride_, pole);
    }
  }

  const Georeference& georeference_;
  const Footprint& footprint_;
  const geo::Lattice lattice_, halves_;
  const bool centres_;
  const std::int64_t first_column_, first_row_;
  const int stride_;
  const double tolerance_;
  std::vector<Position> positions_;
};

}  // namespace

std::vector<Position> NodePositions(const Georeference& georeference, const Footprint& footprint,
                                    const geo::Lattice& lattice, const geo::TileKey& key, double tolerance) {
  return TileNodes(georeference, footprint, lattice, key, tolerance, /*halo=*/1).Compute();
}

std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance) {
  return TileNodes(georeference, footprint, lattice, key, tolerance, /*halo=*/0).Compute();
}

}  // namespace terrace::dem
