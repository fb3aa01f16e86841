#include "engine/crs/undulations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace terrace::dem {
namespace {

constexpr double kUnknownUndulation = std::numeric_limits<double>::quiet_NaN();

// Boxes of the bounds are not wider than the cells of the finest grid that the geoid reads, unless that gives too many
// boxes.
constexpr double kBoxDegrees = 0.125;
constexpr int kMinBoxes = 8, kMaxBoxes = 512;  // along a side

int BoxesAlong(double degrees, double finest_cell) {
  const double box = finest_cell > 0 ? std::min(kBoxDegrees, finest_cell) : kBoxDegrees;
  return static_cast<int>(std::clamp(std::ceil(degrees / box), double{kMinBoxes}, double{kMaxBoxes}));
}

// One global cell of nodes, filled from its corners inwards. Every node is evaluated at most once.
class NodeCell {
 public:
  static constexpr int kSize = 32;  // divides the columns and rows of every grid

  NodeCell(const Geoid::Reader& geoid, double finest_cell, const geo::NodeGrid& grid)
      : geoid_(geoid), largest_(finest_cell / grid.StepDegrees()), grid_(grid) {}

  // The cell whose south-western (for Web Mercator: north-western) node is (column, row). It owns the nodes 0 .. kSize
  // - 1 of both axes; those at kSize are its neighbours'.
  void Fill(std::int64_t column, std::int64_t row) {
    column_ = column;
    row_ = row;
    known_.fill(kUnknownUndulation);
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
    if (size <= largest_ && Interpolate(x, y, size)) return;
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
    // A cell that is not larger than the grid's cells crosses at most one of its meridians and one of its parallels,
    // and deviates by tent functions. Let d be the largest deviation at the five tested points. Along an edge the
    // deviation is a tent, at most 2 d. Inside, it is largest at the grid's own node. At least a quarter of that node's
    // deviation reaches the middle of the cell, beside at most half of the 2 d of the edges: it is at most 4 (d + d).
    const int half = size / 2;
    constexpr std::array<std::pair<int, int>, 5> kMiddles = {{{1, 0}, {0, 1}, {1, 1}, {2, 1}, {1, 2}}};
    for (const auto& [i, j] : kMiddles) {
      const double error = std::abs(between(i * half, j * half) - Exact(x + i * half, y + j * half));
      if (!(error <= Undulations::kTolerance / 8)) return false;  // unknown ones as well
    }
    for (int j = 0; j < size; ++j) {
      for (int i = 0; i < size; ++i) filled_[Index(x + i, y + j)] = between(i, j);
    }
    return true;
  }

  const Geoid::Reader& geoid_;
  const double largest_;  // nodes along the side of a cell that may be interpolated
  const geo::NodeGrid& grid_;
  std::int64_t column_ = 0, row_ = 0;
  std::array<double, std::size_t{kStride} * kStride> known_{}, filled_{};
  std::array<bool, std::size_t{kStride} * kStride> is_known_{};
};

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The table has a range for 64 of its pixels: here for 8 nodes along a side.
constexpr int kPixelsPerNode = 8;

// A margin for rounding in other computations of positions, in steps of the grid.
constexpr double kSlack = 1e-6;

struct IndexRange {
  int first = 0, last = -1;

  bool is_empty() const { return first > last; }
};

// The nodes around positions from .. to, of `count`.
IndexRange Around(double from, double to, int count) {
  return {static_cast<int>(std::max(std::floor(from - kSlack), 0.0)),
          static_cast<int>(std::min(std::floor(to + kSlack) + 1, count - 1.0))};
}

}  // namespace

Result<UndulationRanges> UndulationRanges::Of(const UndulationGrid& grid, const Footprint& area) {
  UndulationRanges ranges(grid);
  ranges.whole_ = {kInfinity, -kInfinity};
  const double north = grid.RowOf(area.north), south = grid.RowOf(area.south);
  const IndexRange rows = Around(north, south, grid.rows());
  const double start = grid.ColumnOf(area.west), extent = (area.east - area.west) / grid.column_step();
  IndexRange columns{grid.columns(), -1};
  bool holds_longitudes = grid.wraps();
  for (const int turn : {-1, 0, 1}) {
    const double from = start + turn * 360 / grid.column_step();
    const IndexRange here = Around(from, from + extent, grid.columns());
    if (here.is_empty()) continue;
    columns = {std::min(columns.first, here.first), std::max(columns.last, here.last)};
    holds_longitudes |= from >= -kSlack && from + extent <= grid.columns() - 1 + kSlack;
  }
  if (rows.is_empty() || columns.is_empty()) return ranges;
  const int width = columns.last - columns.first + 1, height = rows.last - rows.first + 1;
  ranges.first_column_ = columns.first;
  ranges.first_row_ = rows.first;
  ranges.table_ = RangeTable(kPixelsPerNode * width, kPixelsPerNode * height);
  const int strip = std::max(1, (1 << 18) / width);
  for (int row = 0; row < height; row += strip) {
    const int count = std::min(strip, height - row);
    const auto heights = grid.Read(columns.first, rows.first + row, width, count);
    if (!heights) return tl::unexpected(heights.error());
    ranges.table_.AddWindow(0, row, width, count, heights->data(), kPixelsPerNode);
  }
  ranges.table_.Finish();
  const BlockRange all = ranges.table_.Whole();
  if (all.min <= all.max) ranges.whole_ = {all.min, all.max};
  ranges.is_complete_ = !all.has_voids && holds_longitudes && north >= -kSlack && south <= grid.rows() - 1 + kSlack;
  return ranges;
}

HeightRange UndulationRanges::Query(double west, double south, double width, double height) const {
  HeightRange range{kInfinity, -kInfinity};
  if (!(whole_.min <= whole_.max)) return range;
  const IndexRange rows = Around(grid_->RowOf(south + height), grid_->RowOf(south), grid_->rows());
  const double start = grid_->ColumnOf(west);
  for (const int turn : {-1, 0, 1}) {
    const double from = start + turn * 360 / grid_->column_step();
    const IndexRange columns = Around(from, from + width / grid_->column_step(), grid_->columns());
    if (columns.is_empty() || rows.is_empty()) continue;
    const auto pixel = [](int node, int first) { return static_cast<double>(kPixelsPerNode) * (node - first); };
    const BlockRange found = table_.Query(pixel(columns.first, first_column_), pixel(rows.first, first_row_),
                                          pixel(columns.last, first_column_), pixel(rows.last, first_row_));
    if (!(found.min <= found.max)) continue;
    range = {std::min(range.min, double{found.min}), std::max(range.max, double{found.max})};
  }
  return range;
}

Result<std::shared_ptr<const Undulations>> Undulations::OfEarth(std::shared_ptr<const Geoid> geoid) {
  const std::shared_ptr<Undulations> earth(new Undulations(std::move(geoid), {}));
  if (auto poles = earth->FindPoles(); !poles) return tl::unexpected(poles.error());
  return earth;
}

Result<std::shared_ptr<const Undulations>> Undulations::Of(std::shared_ptr<const Geoid> geoid, const Footprint& area) {
  const std::shared_ptr<Undulations> made(new Undulations(std::move(geoid), area));
  if (auto poles = made->FindPoles(); !poles) return tl::unexpected(poles.error());
  if (const UndulationGrid* const grid = made->geoid_->grid()) {
    auto ranges = UndulationRanges::Of(*grid, area);
    if (!ranges) return tl::unexpected(ranges.error());
    made->ranges_ = *std::move(ranges);
  } else {
    made->FillBoxes();
  }
  return made;
}

Result<void> Undulations::FindPoles() {
  const UndulationGrid* const grid = geoid_->grid();
  for (const int pole : {0, 1}) {
    const Position degrees{0, pole == 0 ? -90.0 : 90.0};
    if (grid == nullptr) {
      poles_[pole] = geoid_->Undulation(degrees);
      continue;
    }
    const AxisPosition column = grid->AtColumn(grid->ColumnOf(degrees.x)), row = grid->AtRow(grid->RowOf(degrees.y));
    const auto patch = UndulationPatch::Read(*grid, {&column, 1}, {&row, 1});
    if (!patch) return tl::unexpected(patch.error());
    poles_[pole] = patch->At(column, row);
  }
  return {};
}

// Bounds from the corners and the middle of each box, widened by their difference. If these are at most half a cell
// apart, the middle of a tent is at most a quarter of a cell from one of them, which has half of its height.
void Undulations::FillBoxes() {
  const double finest = geoid_->finest_cell();
  columns_ = BoxesAlong(area_.east - area_.west, finest);
  rows_ = BoxesAlong(area_.north - area_.south, finest);
  boxes_.resize(Area(columns_, rows_));
  bounds_geoid_ = (area_.east - area_.west) / columns_ <= finest && (area_.north - area_.south) / rows_ <= finest;
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
  HeightRange range{kInfinity, -kInfinity};
  const HeightRange& whole = ranges_ ? ranges_->whole() : whole_;
  if (ranges_) range = ranges_->Query(west, south, width, height);
  const double box_width = (area_.east - area_.west) / columns_, box_height = (area_.north - area_.south) / rows_;
  const auto index = [](double position, int count) {
    return static_cast<int>(std::clamp(std::floor(position), -1.0, static_cast<double>(count)));
  };
  // One more box on every side: positions are rounded differently elsewhere, and a node beside an edge belongs to the
  // box at that edge.
  const int bottom = std::max(index((south - area_.south) / box_height, rows_) - 1, 0);
  const int top = std::min(index((south + height - area_.south) / box_height, rows_) + 1, rows_ - 1);
  for (int turn = -1; turn <= 1 && !ranges_; ++turn) {
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
  for (const double pole :
       {south <= -90 ? poles_[0] : kUnknownUndulation, south + height >= 90 ? poles_[1] : kUnknownUndulation}) {
    if (std::isnan(pole)) continue;
    range.min = std::min(range.min, pole);
    range.max = std::max(range.max, pole);
  }
  return range.min <= range.max ? range : whole;
}

// From the grid's nodes, in strips of rows.
Result<void> Undulations::Interpolate(const geo::NodeGrid& grid, const NodeWindow& window,
                                      std::vector<double>& out) const {
  constexpr std::int64_t kMaxNodes = 1 << 18;
  const UndulationGrid& nodes = *geoid_->grid();
  std::vector<AxisPosition> columns, rows;
  for (std::int64_t c = window.column; c < window.column + window.columns; ++c) {
    const double longitude = grid.Longitude(FloorMod(c, grid.columns()));
    const bool is_inside = EastOfArea(longitude) <= area_.east - area_.west;
    columns.push_back(is_inside ? nodes.AtColumn(nodes.ColumnOf(longitude)) : AxisPosition{});
  }
  for (std::int64_t r = window.row; r < window.row + window.rows; ++r) {
    const double latitude = grid.Latitude(r);
    const bool is_inside = r >= 0 && r < grid.rows() && latitude >= area_.south && latitude <= area_.north;
    rows.push_back(is_inside ? nodes.AtRow(nodes.RowOf(latitude)) : AxisPosition{});
  }
  for (std::size_t first = 0; first < rows.size();) {
    // All rows that are left, unless that is too much.
    std::size_t count = rows.size() - first;
    const auto strip = [&] { return std::span(rows).subspan(first, count); };
    while (count > 1 && UndulationPatch::CountNodes(columns, strip()) > kMaxNodes) count = (count + 1) / 2;
    const auto patch = UndulationPatch::Read(nodes, columns, strip());
    if (!patch) return tl::unexpected(patch.error());
    double* to = out.data() + first * columns.size();
    for (const AxisPosition& row : strip()) {
      patch->At(columns, row, {to, columns.size()});
      to += columns.size();
    }
    first += count;
  }
  return {};
}

void Undulations::Evaluate(const geo::NodeGrid& grid, const NodeWindow& window, std::vector<double>& out) const {
  constexpr int kCell = NodeCell::kSize;
  const auto at = [&](std::int64_t column, std::int64_t row) -> double& {
    return out[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
  };
  const Geoid::Reader geoid(*geoid_);
  NodeCell cell(geoid, geoid_->finest_cell(), grid);
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
    const double latitude = grid.Latitude(row);
    for (std::int64_t column = window.column; column < east; ++column) {
      double& value = at(column, row);
      if (std::isnan(value)) continue;
      const double longitude = grid.Longitude(FloorMod(column, grid.columns()));
      if (!IsInside(longitude, latitude)) {
        value = kUnknownUndulation;
      } else if (!boxes_.empty()) {
        const HeightRange& bound = BoxAt(longitude, latitude);
        value = bound.min <= bound.max ? std::clamp(value, bound.min, bound.max) : kUnknownUndulation;
      }
    }
  }
}

Result<std::vector<double>> Undulations::At(const geo::NodeGrid& grid, const NodeWindow& window) const {
  std::vector<double> out(Area(window.columns, window.rows), kUnknownUndulation);
  if (geoid_->grid() == nullptr) {
    Evaluate(grid, window, out);
  } else if (auto done = Interpolate(grid, window, out); !done) {
    return tl::unexpected(done.error());
  }
  for (int row = 0; row < window.rows; ++row) {
    if (!grid.IsPoleRow(window.row + row)) continue;
    std::fill_n(out.begin() + std::ptrdiff_t{row} * window.columns, window.columns,
                poles_[window.row + row <= 0 ? 0 : 1]);
  }
  return out;
}

}  // namespace terrace::dem
