#include "engine/bound/geoid_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "engine/crs/undulation_grid.h"

namespace terrace::dem {
namespace {

constexpr double kRounding = 1e-6;  // metres: error from positions on the grid

// Up to this ratio of a tile's step to the geoid grid's step, grid nodes are evaluated one by one.
constexpr double kDense = 1.5;

bool AreFinite(std::span<const double> values) {
  constexpr std::size_t kLanes = 4;  // independent, so that the compiler can vectorize
  std::array<double, kLanes> sums{};
  std::size_t i = 0;
  for (; i + kLanes <= values.size(); i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) sums[lane] += values[i + lane] - values[i + lane];
  }
  for (; i < values.size(); ++i) sums[0] += values[i] - values[i];
  return sums[0] + sums[1] + sums[2] + sums[3] == 0;
}

}  // namespace

GeoidErrorBound::GeoidErrorBound(const TileNodes& tile, const Undulations* geoid, std::span<const double> added)
    : tile_(tile), geoid_(geoid), added_(added) {
  if (geoid_ == nullptr || geoid_->geoid().grid() == nullptr) return;
  const UndulationGrid& grid = *geoid_->geoid().grid();
  if (tile_.lattice.StepDegrees() > kDense * std::min(grid.column_step(), grid.row_step())) return;
  std::vector<AxisPosition> columns, rows;
  for (int k = 0; k <= tile_.cells(); ++k) {
    columns_.push_back(grid.ColumnOf(tile_.lattice.Longitude(tile_.window.column + 1 + k)));
    rows_.push_back(grid.RowOf(tile_.lattice.Latitude(tile_.window.row + 1 + k)));
    // With a margin: for a node on a grid line, both sides count.
    constexpr double kAround = 0.01;
    for (const double offset : {-kAround, kAround}) {
      columns.push_back(grid.AtColumn(columns_.back() + offset));
      rows.push_back(grid.AtRow(rows_.back() + offset));
    }
  }
  auto patch = UndulationPatch::Read(grid, columns, rows);
  if (!patch) return;
  patch_ = *std::move(patch);
  FindLines(grid);
}

// The ends of each step and the grid lines between them.
void GeoidErrorBound::FindLines(const UndulationGrid& grid) {
  bool is_inside = true;
  const auto add = [&](Steps& steps, double from, double to, const auto& place_of) {
    const auto stop = [&](double at) {
      steps.stops.push_back(at);
      steps.places.push_back(place_of(at));
      is_inside = is_inside && steps.places.back().is_inside();
    };
    stop(from);
    for (double line = std::floor(from) + 1; line < to; ++line) stop(line);
    stop(to);
    steps.first.push_back(steps.stops.size());
  };
  const double width = tile_.lattice.StepDegrees() / grid.column_step();
  for (int i = 0; i < tile_.cells(); ++i) {
    const double west = columns_[static_cast<std::size_t>(i)];
    add(column_steps_, west, west + width, [&](double column) { return grid.AtColumn(column); });
    if (column_steps_.count(i) > 2) column_steps_.crossed.push_back(i);
  }
  for (int j = 0; j < tile_.cells(); ++j) {
    const auto k = static_cast<std::size_t>(j);  // rows of the grid count southwards
    add(row_steps_, rows_[k + 1], rows_[k], [&](double row) { return grid.AtRow(row); });
    if (row_steps_.count(j) > 2 || IsAtPole(j)) row_steps_.crossed.push_back(j);
  }
  is_whole_ = is_inside && patch_->is_whole();
  for (int j = 0; j <= tile_.cells() && is_whole_; ++j) {
    is_whole_ = AreFinite(added_.subspan(tile_.NodeIndex(0, j), static_cast<std::size_t>(tile_.cells()) + 1));
  }
}

// The nodes of a pole share one undulation.
bool GeoidErrorBound::IsAtPole(int row_of_cells) const {
  const std::int64_t row = tile_.window.row + 1 + row_of_cells;
  return row <= 0 || row + 1 >= tile_.lattice.rows();
}

double GeoidErrorBound::BoundOver(const CellBox& box) const {
  if (geoid_ == nullptr) return 0;
  if (patch_) return OverNodes(box);
  if (geoid_->geoid().grid() != nullptr) return OverCoarse(box);
  if (tile_.lattice.StepDegrees() <= geoid_->geoid().finest_cell() / 2) return OverSmooth(box);
  return geoid_->bounds_geoid() ? OverCoarse(box) : kUnknownError;
}

// The geoid is bilinear between its grid lines, and the surface is bilinear between the tile's nodes. Their difference
// is largest where grid lines cross each other or the cell's edges.
// In a cell that no line crosses both are the same bilinear surface, unless the geoid lacks nodes there.
double GeoidErrorBound::OverNodes(const CellBox& box) const {
  double error = 0;
  const auto raise = [&](int i, int j) { error = std::max(error, OverNodes(tile_.Cell(i, j))); };
  if (!is_whole_) {
    for (int j = box.south; j < box.north; ++j) {
      for (int i = box.west; i < box.east; ++i) raise(i, j);
    }
    return error + kRounding;
  }
  const auto for_crossed = [](const std::vector<int>& crossed, int first, int end, const auto& visit) {
    for (auto at = std::ranges::lower_bound(crossed, first); at != crossed.end() && *at < end; ++at) visit(*at);
  };
  for_crossed(column_steps_.crossed, box.west, box.east, [&](int i) {
    for (int j = box.south; j < box.north; ++j) raise(i, j);
  });
  for_crossed(row_steps_.crossed, box.south, box.north, [&](int j) {
    for (int i = box.west; i < box.east; ++i) {
      if (column_steps_.count(i) == 2) raise(i, j);  // the others have been visited
    }
  });
  return error + kRounding;
}

double GeoidErrorBound::OverNodes(const TileCell& cell) const {
  const auto [sw, se, nw, ne] =
      std::array{added_[cell.nodes[0]], added_[cell.nodes[1]], added_[cell.nodes[2]], added_[cell.nodes[3]]};
  if (std::isnan(sw + se + nw + ne)) return kUnknownError;
  const auto i = static_cast<std::size_t>(cell.i), j = static_cast<std::size_t>(cell.j);
  const std::size_t first_column = column_steps_.first[i], end_column = column_steps_.first[i + 1];
  const std::size_t first_row = row_steps_.first[j], end_row = row_steps_.first[j + 1];
  // Next to nodes without a value the geoid is not bilinear.
  for (std::size_t r = first_row; r + 1 < end_row && !is_whole_; ++r) {
    for (std::size_t c = first_column; c + 1 < end_column; ++c) {
      if (!patch_->IsWhole(column_steps_.places[c], row_steps_.places[r])) return OverCoarse(cell.box());
    }
  }
  if (end_column - first_column == 2 && end_row - first_row == 2 && !IsAtPole(cell.j)) return 0;
  const double west = columns_[i], width = tile_.lattice.StepDegrees() / geoid_->geoid().grid()->column_step();
  const double south = rows_[j], north = rows_[j + 1];  // rows of the grid count southwards
  double error = 0;
  for (std::size_t r = first_row; r < end_row; ++r) {
    const double v = (south - row_steps_.stops[r]) / (south - north);
    for (std::size_t c = first_column; c < end_column; ++c) {
      const double u = (column_steps_.stops[c] - west) / width;
      const double geoid = patch_->At(column_steps_.places[c], row_steps_.places[r]);
      const double surface = (sw * (1 - u) + se * u) * (1 - v) + (nw * (1 - u) + ne * u) * v;
      if (std::isnan(geoid)) return kUnknownError;
      error = std::max(error, std::abs(geoid - surface));
    }
  }
  return error;
}

// If the lattice is finer than all grids that the geoid reads, a step between nodes crosses at most one line of each.
// There the error of the chord is at most a quarter of the step times the change of slope, and the larger second
// difference at the ends of the step is at least half of that product. So half a second difference per axis is a bound;
// the whole is used, because the change of slope varies along the line.
double GeoidErrorBound::OverSmooth(const CellBox& box) const {
  const auto at = [&](int i, int j) { return added_[tile_.NodeIndex(i, j)]; };
  double xx = 0, yy = 0, xy = 0, sum = 0;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const double here = at(i, j), east = at(i + 1, j), north = at(i, j + 1);
      const double along = std::abs(east - here - (here - at(i - 1, j)));
      const double across = std::abs(north - here - (here - at(i, j - 1)));
      sum += along + across;
      xx = std::max(xx, along);
      yy = std::max(yy, across);
      if (i < box.east && j < box.north) xy = std::max(xy, std::abs(at(i + 1, j + 1) - north - (east - here)));
    }
  }
  if (!std::isfinite(sum)) return kUnknownError;
  return 2 * Undulations::kTolerance + xx + yy + xy;
}

// From bounds on the geoid around each cell.
double GeoidErrorBound::OverCoarse(const CellBox& box) const {
  double error = 0;
  for (int j = box.south; j < box.north; ++j) {
    for (int i = box.west; i < box.east; ++i) {
      const HeightRange range = RangeOf({i, j, i + 1, j + 1});
      for (const std::size_t node : tile_.Cell(i, j).nodes) {
        const double geoid = added_[node];
        if (std::isnan(geoid)) return kUnknownError;
        error = std::max({error, range.max - geoid, geoid - range.min});
      }
    }
  }
  return error + Undulations::kTolerance;
}

}  // namespace terrace::dem
