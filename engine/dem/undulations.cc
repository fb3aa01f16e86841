#include "engine/dem/undulations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::dem {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Boxes of the bounds are half as wide as the cells of the coarsest geoids in use (EGM96: 15'), but neither few over a
// small area nor many over the whole Earth.
constexpr double kBoxDegrees = 0.125;
constexpr int kFewestBoxes = 8, kMostBoxes = 256;  // along a side

int BoxesAlong(double degrees) {
  return static_cast<int>(std::clamp(std::ceil(degrees / kBoxDegrees), double{kFewestBoxes}, double{kMostBoxes}));
}

bool IsPoleRow(const geo::Lattice& lattice, std::int64_t row) { return row <= 0 || row >= lattice.rows(); }
bool IsPoleRow(const geo::MercatorGrid&, std::int64_t) { return false; }

// One global cell of nodes, filled from its corners inwards; every node is evaluated at most once.
template <typename Grid>
class NodeCell {
 public:
  static constexpr int kSize = 32;  // divides the columns and rows of every grid

  NodeCell(const Geoid::Reader& geoid, const Grid& grid) : geoid_(geoid), grid_(grid) {}

  // The cell whose south-western (for Web Mercator: north-western) node is (column, row). It owns the nodes 0 .. kSize
  // - 1 of both axes; those at kSize are its neighbours'.
  void Fill(std::int64_t column, std::int64_t row) {
    column_ = column;
    row_ = row;
    known_.fill(kUnknown);
    is_known_.fill(false);
    Divide(0, 0, kSize);
  }

  double At(int x, int y) const { return filled_[Index(x, y)]; }

 private:
  static constexpr int kStride = kSize + 1;
  static std::size_t Index(int x, int y) { return static_cast<std::size_t>(y * kStride + x); }

  double Exact(int x, int y) {
    const std::size_t index = Index(x, y);
    if (!is_known_[index]) {
      is_known_[index] = true;
      known_[index] = geoid_.At({grid_.Longitude(column_ + x), grid_.Latitude(row_ + y)});
    }
    return known_[index];
  }

  void Divide(int x, int y, int size) {
    if (size == 1) {
      filled_[Index(x, y)] = Exact(x, y);
      return;
    }
    if (Interpolate(x, y, size)) return;
    const int half = size / 2;
    Divide(x, y, half);
    Divide(x + half, y, half);
    Divide(x, y + half, half);
    Divide(x + half, y + half, half);
  }

  bool Interpolate(int x, int y, int size) {
    const double sw = Exact(x, y), se = Exact(x + size, y), nw = Exact(x, y + size), ne = Exact(x + size, y + size);
    const auto between = [&](int i, int j) {
      const double u = static_cast<double>(i) / size, v = static_cast<double>(j) / size;
      return (sw * (1 - u) + se * u) * (1 - v) + (nw * (1 - u) + ne * u) * v;
    };
    // Geoids are bilinear between the lines of their grid. Along a line through the cell that crosses one of them the
    // deviation is a tent, and at most twice what it is in the middle.
    const int half = size / 2;
    constexpr std::array<std::pair<int, int>, 5> kMiddles = {{{1, 0}, {0, 1}, {1, 1}, {2, 1}, {1, 2}}};
    for (const auto& [i, j] : kMiddles) {
      const double error = std::abs(between(i * half, j * half) - Exact(x + i * half, y + j * half));
      if (!(error <= Undulations::kTolerance / 2)) return false;  // unknown ones as well
    }
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) filled_[Index(x + i, y + j)] = between(i, j);
    }
    return true;
  }

  const Geoid::Reader& geoid_;
  const Grid& grid_;
  std::int64_t column_ = 0, row_ = 0;
  std::array<double, std::size_t{kStride} * kStride> known_{}, filled_{};
  std::array<bool, std::size_t{kStride} * kStride> is_known_{};
};

std::int64_t FloorMod(std::int64_t value, std::int64_t modulus) { return (value % modulus + modulus) % modulus; }

}  // namespace

Undulations::Undulations(std::shared_ptr<const Geoid> geoid, const Footprint& area)
    : geoid_(std::move(geoid)), area_(area) {
  columns_ = BoxesAlong(area_.east - area_.west);
  rows_ = BoxesAlong(area_.north - area_.south);
  boxes_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  FillBoxes();
}

// From the corners and the middle of each box, and as much to spare as they differ.
void Undulations::FillBoxes() {
  const int stride = 2 * columns_ + 1;
  std::vector<Position> positions;
  for (int j = 0; j <= 2 * rows_; ++j) {
    for (int i = 0; i <= 2 * columns_; ++i) {
      positions.push_back({area_.west + (area_.east - area_.west) * i / (2 * columns_),
                           std::clamp(area_.south + (area_.north - area_.south) * j / (2 * rows_), -90.0, 90.0)});
    }
  }
  std::vector<double> values;
  values.reserve(positions.size());
  const Geoid::Reader geoid(*geoid_);
  for (const Position& position : positions) values.push_back(geoid.At(position));
  poles_[0] = geoid.At({0, -90});
  poles_[1] = geoid.At({0, 90});
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  whole_ = {kInfinity, -kInfinity};
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      HeightRange found{kInfinity, -kInfinity};
      for (int k = 0; k < 9; ++k) {
        const double value = values[static_cast<std::size_t>((2 * row + k / 3) * stride + 2 * column + k % 3)];
        is_complete_ &= !std::isnan(value);
        if (std::isnan(value)) continue;
        found.min = std::min(found.min, value);
        found.max = std::max(found.max, value);
      }
      if (found.min <= found.max) {
        const double spare = found.max - found.min + kTolerance;
        found = {found.min - spare, found.max + spare};
        whole_ = {std::min(whole_.min, found.min), std::max(whole_.max, found.max)};
      }
      Box(column, row) = found;
    }
  }
}

double Undulations::EastOfArea(double longitude) const {
  return longitude - area_.west - 360 * std::floor((longitude - area_.west) / 360);
}

bool Undulations::IsInside(double longitude, double latitude) const {
  return latitude >= area_.south && latitude <= area_.north && EastOfArea(longitude) <= area_.east - area_.west;
}

const HeightRange& Undulations::BoxAt(double longitude, double latitude) const {
  const auto index = [](double share, int count) {
    return static_cast<int>(std::clamp(std::floor(share * count), 0.0, count - 1.0));
  };
  return Box(index(EastOfArea(longitude) / (area_.east - area_.west), columns_),
             index((latitude - area_.south) / (area_.north - area_.south), rows_));
}

HeightRange Undulations::RangeOf(double west, double south, double width, double height) const {
  HeightRange range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const double box_width = (area_.east - area_.west) / columns_, box_height = (area_.north - area_.south) / rows_;
  const auto index = [](double position, int count) {
    return static_cast<int>(std::clamp(std::floor(position), -1.0, static_cast<double>(count)));
  };
  // One box more on every side: positions are computed in other orders elsewhere, and a node beside an edge counts in
  // the box at that edge.
  const int bottom = std::max(index((south - area_.south) / box_height, rows_) - 1, 0);
  const int top = std::min(index((south + height - area_.south) / box_height, rows_) + 1, rows_ - 1);
  for (int turn = -1; turn <= 1; ++turn) {
    const double start = EastOfArea(west) + 360 * turn;
    if (start > area_.east - area_.west + box_width || start + width < -box_width) continue;
    const int left = std::max(index(start / box_width, columns_) - 1, 0);
    const int right = std::min(index((start + width) / box_width, columns_) + 1, columns_ - 1);
    for (int row = bottom; row <= top; ++row) {
      for (int column = left; column <= right; ++column) {
        range.min = std::min(range.min, Box(column, row).min);
        range.max = std::max(range.max, Box(column, row).max);
      }
    }
  }
  for (const double pole : {south <= -90 ? poles_[0] : kUnknown, south + height >= 90 ? poles_[1] : kUnknown}) {
    if (std::isnan(pole)) continue;
    range.min = std::min(range.min, pole);
    range.max = std::max(range.max, pole);
  }
  return range.min <= range.max ? range : whole_;
}

template <typename Grid>
std::vector<double> Undulations::AtNodes(const Grid& grid, const NodeWindow& window) const {
  constexpr int kCell = NodeCell<Grid>::kSize;
  std::vector<double> out(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows), kUnknown);
  const auto at = [&](std::int64_t column, std::int64_t row) -> double& {
    return out[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
  };
  const Geoid::Reader geoid(*geoid_);
  NodeCell<Grid> cell(geoid, grid);
  const std::int64_t east = window.column + window.columns, end = window.row + window.rows;
  const auto floor_cell = [](std::int64_t node) { return node - FloorMod(node, kCell); };
  for (std::int64_t row = floor_cell(std::max<std::int64_t>(window.row, 0)); row < std::min(end, grid.rows());
       row += kCell) {
    for (std::int64_t column = floor_cell(window.column); column < east; column += kCell) {
      const std::int64_t canonical = FloorMod(column, grid.columns());
      const auto [south, north] = std::minmax({grid.Latitude(row), grid.Latitude(row + kCell)});
      if (!area_.Touches(grid.Longitude(canonical), south, kCell * grid.StepDegrees(), north - south)) continue;
      cell.Fill(canonical, row);
      for (std::int64_t r = std::max(row, window.row); r < std::min(row + kCell, end); ++r) {
        for (std::int64_t c = std::max(column, window.column); c < std::min(column + kCell, east); ++c) {
          at(c, r) = cell.At(static_cast<int>(c - column), static_cast<int>(r - row));
        }
      }
    }
  }
  for (std::int64_t row = window.row; row < end; ++row) {
    if (IsPoleRow(grid, row)) {
      std::fill_n(&at(window.column, row), window.columns, poles_[row <= 0 ? 0 : 1]);
      continue;
    }
    for (std::int64_t column = window.column; column < east; ++column) {
      double& value = at(column, row);
      if (std::isnan(value)) continue;
      if (!IsInside(grid.Longitude(FloorMod(column, grid.columns())), grid.Latitude(row))) {
        value = kUnknown;
        continue;
      }
      const HeightRange& bound = BoxAt(grid.Longitude(FloorMod(column, grid.columns())), grid.Latitude(row));
      value = bound.min <= bound.max ? std::clamp(value, bound.min, bound.max) : kUnknown;
    }
  }
  return out;
}

std::vector<double> Undulations::At(const geo::Lattice& lattice, const NodeWindow& window) const {
  return AtNodes(lattice, window);
}

std::vector<double> Undulations::At(const geo::MercatorGrid& grid, const NodeWindow& window) const {
  return AtNodes(grid, window);
}

}  // namespace terrace::dem
