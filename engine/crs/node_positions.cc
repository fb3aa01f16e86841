#include "engine/crs/node_positions.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

namespace terrace::dem {
namespace {

constexpr int kMaxCell = 128;

// A square of `size` x `size` nodes; it owns the nodes on its western and southern edges.
struct Cell {
  std::int64_t column, row;
  int size;
};

// The size of the largest cells of a grid with this number of rows. It divides the size of the grid, so that cells
// never cross the antimeridian or a pole.
int LargestCell(std::int64_t rows) { return static_cast<int>(std::min<std::int64_t>(rows & -rows, kMaxCell)); }

// Cells are interpolated from kKnots x kKnots positions, the outermost on their edges. Smaller cells than these have
// hardly more nodes.
constexpr int kMinCell = 2 * (kKnots - 1);

// Lagrange weights of the knots at `step` nodes from a cell's edge.
std::array<double, kKnots> Weights(double step, int size) {
  const double t = step * (kKnots - 1) / size;
  std::array<double, kKnots> weights;
  for (int i = 0; i < kKnots; ++i) {
    double weight = 1;
    for (int k = 0; k < kKnots; ++k) {
      if (k != i) weight *= (t - k) / (i - k);
    }
    weights[static_cast<std::size_t>(i)] = weight;
  }
  return weights;
}

// By knot and step.
using CellWeights = std::array<std::array<double, kMaxCell>, kKnots>;

// For cells of this size: each size is computed once.
const CellWeights& WeightsOf(int size) {
  static const auto all = [] {
    std::array<CellWeights, std::bit_width(unsigned{kMaxCell / kMinCell})> weights{};
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const int cell = kMinCell << i;
      for (int step = 0; step < cell; ++step) {
        const std::array<double, kKnots> of_step = Weights(step, cell);
        for (std::size_t knot = 0; knot < of_step.size(); ++knot) {
          weights[i][knot][static_cast<std::size_t>(step)] = of_step[knot];
        }
      }
    }
    return weights;
  }();
  return all[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(size / kMinCell)))];
}

// Centres of a lattice's cells, each counted as the node at its south-western corner.
struct CellCentres {
  explicit CellCentres(const geo::Lattice& lattice) : halves{lattice.level, 2 * lattice.cells} {}

  double Longitude(std::int64_t column) const { return halves.Longitude(2 * column + 1); }
  double Latitude(std::int64_t row) const { return halves.Latitude(2 * row + 1); }
  double StepDegrees() const { return 2 * halves.StepDegrees(); }
  std::int64_t rows() const { return halves.rows() / 2; }
  bool IsPoleRow(std::int64_t /*row*/) const { return false; }

  geo::Lattice halves;
};

template <typename Grid>
class GridNodes {
 public:
  GridNodes(const Georeference& georeference, const Footprint& footprint, const Grid& grid, const NodeWindow& window,
            double tolerance)
      : georeference_(georeference), footprint_(footprint), grid_(grid), window_(window), tolerance_(tolerance) {}

  NodePositions Compute() && {
    if (georeference_.is_affine() && georeference_.is_geographic_grid()) return ColumnsAndRows();
    positions_.assign(Area(window_.columns, window_.rows), kNowhere);
    FillNodes();
    return {window_, std::move(positions_), extent_};
  }

 private:
  void FillNodes() {
    if (georeference_.is_affine()) {
      FillExactly(window_.column, window_.row, window_.columns, window_.rows);
    } else {
      const int size = LargestCell(grid_.rows());
      const auto floor = [size](std::int64_t node) { return node - (node % size + size) % size; };
      const std::int64_t last_row = std::min(window_.row + window_.rows - 1, grid_.rows() - 1);
      const std::int64_t east = window_.column + window_.columns;
      first_column_ = floor(window_.column);
      first_row_ = floor(std::max<std::int64_t>(window_.row, 0));
      knots_across_ = (floor(east - 1) + size - first_column_) / kKnotSpacing + 1;
      const std::int64_t knots_up = std::max<std::int64_t>(floor(last_row) + size - first_row_, 0) / kKnotSpacing + 1;
      knots_.assign(static_cast<std::size_t>(knots_across_ * knots_up), kNotAsked);
      for (std::int64_t row = first_row_; row <= last_row; row += size) {
        for (std::int64_t column = first_column_; column < east; column += size) Fill({column, row, size});
      }
    }
    extent_.are_all_known &= filled_ == positions_.size();
    FillPoleRows();
  }

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
      const double latitude = grid_.Latitude(r);
      for (std::int64_t c = column; c < column + columns; ++c) *At(c, r) = {grid_.Longitude(c), latitude};
      const std::span<Position> nodes(At(column, r), static_cast<std::size_t>(columns));
      georeference_.ToPixels(nodes);
      Count(ExtentOf(nodes), nodes.size());
    }
  }

  NodePositions ColumnsAndRows() const {
    std::vector<Position> columns(static_cast<std::size_t>(window_.columns)),
        rows(static_cast<std::size_t>(window_.rows));
    for (std::size_t c = 0; c < columns.size(); ++c) {
      columns[c] = Degrees(window_.column + static_cast<std::int64_t>(c), window_.row);
    }
    for (std::size_t r = 0; r < rows.size(); ++r) {
      rows[r] = Degrees(window_.column, window_.row + static_cast<std::int64_t>(r));
    }
    georeference_.ToPixels(columns);
    georeference_.ToPixels(rows);
    std::vector<double> x, y;
    for (const Position& column : columns) x.push_back(column.x);
    for (const Position& row : rows) y.push_back(row.y);
    return {window_, std::move(x), std::move(y)};
  }

  bool Touches(const Cell& cell) const {
    const auto [south, north] = std::minmax({grid_.Latitude(cell.row), grid_.Latitude(cell.row + cell.size)});
    return footprint_.Touches(grid_.Longitude(cell.column), south, cell.size * grid_.StepDegrees(), north - south);
  }

  void Fill(const Cell& cell) {
    const Part part = Inside(cell);
    if (part.empty() || !Touches(cell)) return;
    if (cell.size < kMinCell) {
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
    // The knots, and eight nodes where a polynomial term of the next degree is near its maximum.
    constexpr std::size_t kTried = 8;
    const int spacing = cell.size / (kKnots - 1), half = cell.size / 2, near = cell.size / 8, far = cell.size - near;
    const std::array<std::array<int, 2>, kTried> tried = {
        {{near, half}, {half, near}, {far, half}, {half, far}, {near, near}, {far, near}, {near, far}, {far, far}}};
    constexpr std::size_t kAll = kKnots * kKnots + kTried;
    std::array<Position, kAll> known, fresh;
    std::array<Position*, kAll> place_of, asked_for;
    std::size_t asked = 0;
    const bool are_shared = near % kKnotSpacing == 0;
    const auto ask = [&](std::size_t i, std::int64_t column, std::int64_t row) {
      place_of[i] = are_shared ? KnotAt(column, row) : &known[i];
      if (are_shared && IsAsked(*place_of[i])) return;
      fresh[asked] = Degrees(column, row);
      asked_for[asked++] = place_of[i];
    };
    for (int i = 0; i < kKnots * kKnots; ++i) {
      ask(static_cast<std::size_t>(i), cell.column + i % kKnots * spacing, cell.row + i / kKnots * spacing);
    }
    for (std::size_t i = 0; i < kTried; ++i) {
      ask(kKnots * kKnots + i, cell.column + tried[i][0], cell.row + tried[i][1]);
    }
    georeference_.ToPixels({fresh.data(), asked});
    for (std::size_t i = 0; i < asked; ++i) *asked_for[i] = fresh[i];
    for (std::size_t i = 0; i < kAll; ++i) known[i] = *place_of[i];
    if (std::ranges::any_of(known, [](const Position& p) { return std::isnan(p.x); })) return false;
    // Interpolates the knots' columns at one row, then nodes of that row.
    const CellWeights& weights = WeightsOf(cell.size);
    const auto row_at = [&](std::int64_t row) {
      const auto step = static_cast<std::size_t>(row - cell.row);
      std::array<Position, kKnots> sums;
      for (std::size_t i = 0; i < sums.size(); ++i) {
        for (std::size_t j = 0; j < weights.size(); ++j) {
          sums[i].x += weights[j][step] * known[kKnots * j + i].x;
          sums[i].y += weights[j][step] * known[kKnots * j + i].y;
        }
      }
      return sums;
    };
    const auto weights_from = [&](std::int64_t step) {
      std::array<const double*, kKnots> from;
      for (std::size_t i = 0; i < from.size(); ++i) from[i] = weights[i].data() + step;
      return from;
    };
    for (std::size_t i = 0; i < kTried; ++i) {
      Position tried_at;
      InterpolatePositions(row_at(cell.row + tried[i][1]), weights_from(tried[i][0]), {&tried_at, 1});
      const Position& exact = known[kKnots * kKnots + i];
      if (!(std::abs(tried_at.x - exact.x) <= tolerance_ && std::abs(tried_at.y - exact.y) <= tolerance_)) return false;
    }
    const std::array<const double*, kKnots> of_columns = weights_from(part.west - cell.column);
    const auto columns = static_cast<std::size_t>(part.east - part.west);
    for (std::int64_t row = part.south; row < part.north; ++row) {
      Count(InterpolatePositions(row_at(row), of_columns, {At(part.west, row), columns}), columns);
    }
    return true;
  }

  Position* KnotAt(std::int64_t column, std::int64_t row) {
    return &knots_[static_cast<std::size_t>((row - first_row_) / kKnotSpacing * knots_across_ +
                                            (column - first_column_) / kKnotSpacing)];
  }
  static bool IsAsked(const Position& knot) { return knot.x != kNotAsked.x; }  // NaN: it has no position

  // Adds nodes that were filled to the extent of all.
  void Count(const PositionExtent& extent, std::size_t nodes) {
    extent_.Add(extent);
    filled_ += nodes;
  }

  void FillPoleRows() {
    bool has_poles = false;
    for (std::int64_t row = window_.row; row < window_.row + window_.rows; ++row) {
      if (!grid_.IsPoleRow(row)) continue;
      has_poles = true;
      Position pole{0, grid_.Latitude(row)};
      georeference_.ToPixels({&pole, 1});
      std::fill_n(At(window_.column, row), window_.columns, pole);
    }
    if (has_poles) extent_ = ExtentOf(positions_);  // other positions were counted for these nodes
  }

  const Georeference& georeference_;
  const Footprint& footprint_;
  const Grid grid_;
  const NodeWindow window_;
  const double tolerance_;
  std::vector<Position> positions_;
  PositionExtent extent_;   // of the positions that are filled
  std::size_t filled_ = 0;  // nodes

  // Exact positions of every kKnotSpacing-th node, row by row from the first cell's; cells of 32 nodes and more share
  // them with the cells beside them and with their parts.
  static constexpr int kKnotSpacing = 4;
  static constexpr Position kNotAsked{std::numeric_limits<double>::infinity(), 0};
  std::int64_t first_column_ = 0, first_row_ = 0, knots_across_ = 0;
  std::vector<Position> knots_;
};

}  // namespace

NodeWindow WindowOfTile(const geo::Lattice& lattice, const geo::TileKey& key) {
  return {lattice.FirstColumn(key) - 1, lattice.FirstRow(key) - 1, lattice.cells + 3, lattice.cells + 3};
}

NodePositions NodePositions::Of(const Georeference& georeference, const Footprint& footprint, const geo::NodeGrid& grid,
                                const NodeWindow& window, double tolerance) {
  return GridNodes(georeference, footprint, grid, window, tolerance).Compute();
}

std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance) {
  const NodeWindow window{lattice.FirstColumn(key), lattice.FirstRow(key), lattice.cells, lattice.cells};
  const NodePositions found = GridNodes(georeference, footprint, CellCentres(lattice), window, tolerance).Compute();
  std::vector<Position> centres;
  centres.reserve(found.columns() * found.rows());
  for (std::size_t j = 0; j < found.rows(); ++j) {
    for (std::size_t i = 0; i < found.columns(); ++i) centres.push_back(found.At(i, j));
  }
  return centres;
}

}  // namespace terrace::dem
