#include "engine/dem/bound/geoid_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "engine/dem/crs/undulation_grid.h"

namespace terrace::dem {
namespace {

constexpr double kRounding = 1e-6;  // metres: error from positions on the grid

// Up to this ratio of a tile's step to the geoid grid's step, grid nodes are evaluated one by one.
constexpr double kDense = 1.5;

// The ends of a step and the grid lines between them.
struct Stops {
  explicit Stops(double from, double to) {
    Add(from);
    for (double line = std::floor(from) + 1; line < to; ++line) Add(line);
    Add(to);
  }
  void Add(double at) { stops[static_cast<std::size_t>(count++)] = at; }
  std::span<const double> all() const { return {stops.data(), static_cast<std::size_t>(count)}; }
  bool has_lines() const { return count > 2; }

  std::array<double, 8> stops{};
  int count = 0;
};

}  // namespace

GeoidErrorBound::GeoidErrorBound(const TileNodes& tile, const Undulations* geoid, std::span<const double> added)
    : tile_(tile), geoid_(geoid), added_(added) {
  if (geoid_ == nullptr || geoid_->geoid().grid() == nullptr) return;
  const UndulationGrid& grid = *geoid_->geoid().grid();
  if (tile_.lattice.StepDegrees() > kDense * std::min(grid.column_step(), grid.row_step())) return;
  std::vector<NodePlace> columns, rows;
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
  if (patch) patch_ = *std::move(patch);
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
double GeoidErrorBound::OverNodes(const CellBox& box) const {
  double error = 0;
  for (int j = box.south; j < box.north; ++j) {
    for (int i = box.west; i < box.east; ++i) error = std::max(error, OverNodes(tile_.Cell(i, j)));
  }
  return error + kRounding;
}

double GeoidErrorBound::OverNodes(const TileCell& cell) const {
  const auto [sw, se, nw, ne] =
      std::array{added_[cell.nodes[0]], added_[cell.nodes[1]], added_[cell.nodes[2]], added_[cell.nodes[3]]};
  if (std::isnan(sw + se + nw + ne)) return kUnknownError;
  const UndulationGrid& grid = *geoid_->geoid().grid();
  const double step = tile_.lattice.StepDegrees();
  const auto i = static_cast<std::size_t>(cell.i), j = static_cast<std::size_t>(cell.j);
  const double west = columns_[i], width = step / grid.column_step();
  const double south = rows_[j], north = rows_[j + 1];  // rows of the grid count southwards
  const Stops columns(west, west + width), rows(north, south);
  const std::int64_t row = tile_.window.row + 1 + cell.j;
  const bool at_pole = row <= 0 || row + 1 >= tile_.lattice.rows();  // whose nodes share one undulation
  // Next to nodes without a value the geoid is not bilinear.
  for (const double r : rows.all().first(rows.all().size() - 1)) {
    for (const double c : columns.all().first(columns.all().size() - 1)) {
      if (!patch_->IsWhole(grid.AtColumn(c), grid.AtRow(r))) return OverCoarse(cell.box());
    }
  }
  if (!columns.has_lines() && !rows.has_lines() && !at_pole) return 0;
  double error = 0;
  for (const double r : rows.all()) {
    const NodePlace at_row = grid.AtRow(r);
    const double v = (south - r) / (south - north);
    for (const double c : columns.all()) {
      const double u = (c - west) / width, geoid = patch_->At(grid.AtColumn(c), at_row);
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
  const auto at = [&](int i, int j) { return added_[tile_.NodeOf(i, j)]; };
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
