#include "engine/bound/smooth_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/raster/nan_heights.h"
#include "engine/raster/node_rows.h"

namespace terrace::dem {
namespace {

// A bound on the deviation from its chord over `length` samples of a function that is linear between samples and has
// second differences of at most 1. A chord of less than one sample has at most one kink; longer ones deviate by
// (length^2 + 1) / 8.
double ChordError(double length) { return length < 1 ? length / 4 : (length * length + 1) / 8; }

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// In several independent lanes, so that the compiler can vectorize.
template <typename Step>
std::array<float, 8> InLanes(const float* values, std::size_t count, const Step& step) {
  std::array<float, 8> lanes{};
  std::size_t i = 0;
  for (; i + lanes.size() <= count; i += lanes.size()) {
    for (std::size_t lane = 0; lane < lanes.size(); ++lane) lanes[lane] = step(lanes[lane], values[i + lane]);
  }
  for (; i < count; ++i) lanes[i % lanes.size()] = step(lanes[i % lanes.size()], values[i]);
  return lanes;
}

// The largest of values that are 0 or greater.
float Largest(const float* values, std::size_t count) {
  const auto lanes = InLanes(values, count, [](float known, float value) { return value > known ? value : known; });
  return *std::ranges::max_element(lanes);
}

float Sum(const float* values, std::size_t count) {
  const auto lanes = InLanes(values, count, [](float known, float value) { return known + value; });
  return std::accumulate(lanes.begin(), lanes.end(), 0.0f);
}

}  // namespace

SmoothErrorBound::SmoothErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridReading& reading,
                                   const GridStatistics& statistics, const GeoidErrorBound& geoid, bool blends)
    : tile_(tile),
      reading_(reading),
      statistics_(statistics),
      geoid_(geoid),
      blends_(blends),
      position_error_(MaxPositionError(grid.georeference())),
      misplacement_{statistics.misplacement().x / reading.factor, statistics.misplacement().y / reading.factor} {
  PlaceNodes(grid);
}

// Nodes that took their height from this raster grid. Averages are not evenly spaced at the end of an axis whose last
// average covers fewer samples. Beyond the outermost averages, where the surface is constant, all places are those of
// the averages: the steps between places change there, which counts as a bend.
void SmoothErrorBound::PlaceNodes(const RasterGrid& grid) {
  const GridAxis columns(grid.columns(), reading_.factor, grid.wraps()), rows(grid.rows(), reading_.factor, false);
  const auto last = [&](const GridAxis& axis, int samples) {
    return static_cast<double>(axis.count() - (samples % reading_.factor == 0 ? 1 : 2));
  };
  const double last_x = last(columns, grid.columns()) - misplacement_.x;
  const double last_y = last(rows, grid.rows()) - misplacement_.y;
  const auto of_column = [&](std::int64_t column, double weight) {
    const double x = static_cast<double>(column) + weight;
    const bool is_even = (grid.wraps() && grid.columns() % reading_.factor == 0) || (x >= 0 && x <= last_x);
    return is_even ? x : kUnknown;
  };
  const auto of_row = [&](std::int64_t row, double weight) {
    const double y = static_cast<double>(row) + weight;
    return y >= 0 && y <= last_y ? y : kUnknown;
  };
  const NodeCells& cells = reading_.cells;
  const NodeWindow& part = cells.window();  // nodes beyond have no height from this raster grid
  const auto west = static_cast<std::size_t>(part.column - tile_.window.column);
  const auto south = static_cast<std::size_t>(part.row - tile_.window.row);
  is_separable_ = cells.is_separable();
  if (is_separable_) {
    const auto rows_there = static_cast<std::size_t>(tile_.window.rows);
    x_ = std::make_unique_for_overwrite<double[]>(tile_.stride());
    y_ = std::make_unique_for_overwrite<double[]>(rows_there);
    std::fill_n(x_.get(), tile_.stride(), kUnknown);
    std::fill_n(y_.get(), rows_there, kUnknown);
    for (std::size_t i = 0; i < cells.columns().size(); ++i) {
      x_[west + i] = of_column(cells.columns()[i].index, cells.columns()[i].weight);
    }
    for (std::size_t j = 0; j < cells.rows().size(); ++j) {
      y_[south + j] = of_row(cells.rows()[j].index, cells.rows()[j].weight);
    }
    return;
  }
  const std::size_t nodes = reading_.heights.size(), columns_here = cells.positions().columns();
  x_ = std::make_unique_for_overwrite<double[]>(nodes);
  y_ = std::make_unique_for_overwrite<double[]>(nodes);
  if (cells.positions().rows() < static_cast<std::size_t>(tile_.window.rows) || columns_here < tile_.stride()) {
    std::fill_n(x_.get(), nodes, kUnknown);
    std::fill_n(y_.get(), nodes, kUnknown);
  }
  for (std::size_t j = 0; j < cells.positions().rows(); ++j) {
    const std::size_t first = (south + j) * tile_.stride() + west;
    double *const x = x_.get() + first, *const y = y_.get() + first;
    const float* const heights = reading_.heights.data() + first;
    const bool are_all_known = GridCoordinatesOf(cells.positions().Row(j), cells.axes(), {heights, columns_here},
                                                 {last_x, last_y}, {x, columns_here}, {y, columns_here});
    for (std::size_t i = 0; !are_all_known && i < columns_here; ++i) {
      if (std::isnan(heights[i]) || !std::isnan(x[i])) continue;
      const GridCell cell = cells.At(i, j);
      x[i] = of_column(cell.column, cell.x);
      y[i] = of_row(cell.row, cell.y);
      if (std::isnan(x[i] + y[i])) x[i] = y[i] = kUnknown;
    }
  }
}

// Returns false if one of the nodes `first` to `end` of a row of the tile's window has no height from this raster grid.
bool SmoothErrorBound::GaveHeights(std::size_t row, std::size_t first, std::size_t end) const {
  return !HasVoids(std::span(reading_.heights).subspan(row * tile_.stride() + first, end - first));
}

PixelBounds SmoothErrorBound::BoundsOf(const CellBox& box) const {
  PixelBounds bounds;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const std::size_t n = tile_.NodeIndex(i, j);
      const double x = is_separable_ ? x_[static_cast<std::size_t>(i + 1)] : x_[n];
      const double y = is_separable_ ? y_[static_cast<std::size_t>(j + 1)] : y_[n];
      if (std::isnan(x + y) || std::isnan(reading_.heights[n])) return {};
      bounds.Add(x, y);
    }
  }
  return bounds;
}

double SmoothErrorBound::Largest(const Differences& differences, const NodeSteps& steps) {
  const auto along = [&](double x, double y) {
    return ChordError(x) * differences.xx + ChordError(y) * differences.yy + x * y * differences.xy / 4;
  };
  return along(steps.east_x, steps.east_y) + along(steps.north_x, steps.north_y) + steps.bend_x * differences.x +
         steps.bend_y * differences.y;
}

// The largest difference between served heights and the raster grid's own, at the nodes of a box.
double SmoothErrorBound::LargestBlend(const CellBox& box) const {
  if (!blends_) return 0;
  float largest = 0;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const std::size_t n = tile_.NodeIndex(i, j);
      largest = std::max(largest, std::abs(tile_.heights[n] - reading_.heights[n]));
    }
  }
  return largest;
}

bool SmoothErrorBound::Measure(const CellBox& box, NodeSteps& steps, PixelBounds& at) const {
  if (is_separable_) {
    if (!MeasureAxes(box, steps, at)) return false;
  } else {
    const std::size_t n = tile_.NodeIndex(box.west, box.south);
    const NodeCoordinates places{x_.get() + n, y_.get() + n, tile_.stride()};
    if (!MeasureSteps(places, box.east - box.west, box.north - box.south, steps, at)) return false;
  }
  // A line with second difference b deviates from its chord by b / 8, and half as much again covers changes of b in
  // both directions. At the outermost averages places stop between two nodes: a part a of a step of length s is lost,
  // the steps differ by a or by s - a, and a place is at most a (s - a) / s, half of the larger one, off the chord.
  constexpr double kOffChord = 0.5;
  steps.bend_x = steps.bend_x * kOffChord + position_error_ + misplacement_.x;
  steps.bend_y = steps.bend_y * kOffChord + position_error_ + misplacement_.y;
  at.Grow(misplacement_.x, misplacement_.y);
  return true;
}

// Columns of nodes run along columns of samples, rows along rows: each step has one axis.
bool SmoothErrorBound::MeasureAxes(const CellBox& box, NodeSteps& steps, PixelBounds& at) const {
  const auto west = static_cast<std::size_t>(box.west + 1), south = static_cast<std::size_t>(box.south + 1);
  const auto east = static_cast<std::size_t>(box.east + 1), north = static_cast<std::size_t>(box.north + 1);
  // A node's neighbours count as well.
  const bool are_known = box.south >= known_south_ && box.north <= known_north_;
  if (!are_known) {
    if (!GaveHeights(south - 1, west, east + 1) || !GaveHeights(north + 1, west, east + 1)) return false;
    for (std::size_t j = south; j <= north; ++j) {
      if (!GaveHeights(j, west - 1, east + 2)) return false;
    }
  }
  double finite = 0;  // becomes NaN if a place is
  const auto measure = [&](const double* places, std::size_t first, std::size_t last, double& step, double& bend) {
    for (std::size_t k = first; k <= last; ++k) {
      const double after = places[k + 1] - places[k], before = places[k] - places[k - 1];
      finite += after + before;
      if (k < last) step = std::max(step, std::abs(after));
      bend = std::max(bend, std::abs(after - before));
    }
  };
  measure(x_.get(), west, east, steps.east_x, steps.bend_x);
  measure(y_.get(), south, north, steps.north_y, steps.bend_y);
  for (std::size_t i = west; i <= east; ++i) at.Add(x_[i], y_[south]);
  for (std::size_t j = south; j <= north; ++j) at.Add(x_[west], y_[j]);
  return std::isfinite(finite);
}

double SmoothErrorBound::BoundOver(const CellBox& box) {
  NodeSteps steps;
  PixelBounds at;
  if (!Measure(box, steps, at)) return kUnknown;
  Differences differences;
  const SampleBox range = AveragesIn(at);
  if (!Measure(range, differences)) return kUnknown;
  return Largest(differences, steps) + geoid_.BoundOver(box) + LargestBlend(box) +
         statistics_.AveragingError(static_cast<double>(range.west), static_cast<double>(range.north),
                                    static_cast<double>(range.east), static_cast<double>(range.south));
}

SampleBox SmoothErrorBound::AveragesIn(const PixelBounds& at) const {
  const auto first = [](double place) { return static_cast<std::int64_t>(std::floor(place)); };
  return {first(at.west), first(at.north), first(at.east) + 1, first(at.south) + 1};
}

// Beyond the outermost averages the surface is constant.
SampleBox SmoothErrorBound::Clipped(SampleBox range) const {
  const GridWindow& window = reading_.window;
  return {std::max(range.west, window.column), std::max(range.north, window.row),
          std::min(range.east, window.column + window.columns - 1),
          std::min(range.south, window.row + window.rows - 1)};
}

bool SmoothErrorBound::Measure(const SampleBox& range, Differences& differences) {
  const SampleBox in = Clipped(range);
  if (in.empty()) return false;
  const bool is_in_band = in.north == band_.top && in.south == band_.bottom;
  if (!is_in_band) MeasureColumns(in, box_);
  const ColumnDifferences& of_column = is_in_band ? band_ : box_;
  const auto first = static_cast<std::size_t>(is_in_band ? in.west - reading_.window.column : 0);
  const auto columns = static_cast<std::size_t>(in.east - in.west + 1);
  const auto largest = [&](const std::vector<float>& values, std::size_t count) {
    constexpr double kUp = 1 + 1e-6;  // rounding of differences of floats
    return dem::Largest(values.data() + first, count) * kUp;
  };
  differences = {largest(of_column.x, columns - 1), largest(of_column.y, columns),
                 largest(of_column.xx, columns > 2 ? columns - 2 : 0), largest(of_column.yy, columns),
                 largest(of_column.xy, columns - 1)};
  return std::isfinite(Sum(of_column.sum.data() + first, columns));
}

void SmoothErrorBound::MeasureColumns(const SampleBox& range, ColumnDifferences& differences) const {
  const GridWindow& window = reading_.window;
  differences.Resize(static_cast<std::size_t>(range.east - range.west + 1));
  MeasureDifferences(
      reading_.samples.data() + (range.north - window.row) * window.columns + (range.west - window.column),
      static_cast<std::size_t>(window.columns), static_cast<std::size_t>(range.south - range.north + 1), differences);
}

// All boxes of a row of cells use the same rows of samples: differences are computed once for all, along whole rows.
void SmoothErrorBound::PrepareRows(int south, int north) {
  band_.top = 0, band_.bottom = -1;
  if (!is_separable_ || reading_.samples.empty()) return;
  const auto rows = static_cast<std::size_t>(north - south + 3);
  const auto nodes = std::span(reading_.heights).subspan(static_cast<std::size_t>(south) * tile_.stride());
  const bool are_known = !HasVoids(nodes.first(rows * tile_.stride()));
  known_south_ = are_known ? south : 0;
  known_north_ = are_known ? north : -1;
  const double y0 = y_[static_cast<std::size_t>(south + 1)], y1 = y_[static_cast<std::size_t>(north + 1)];
  if (std::isnan(y0 + y1)) return;
  PixelBounds at;
  at.Add(0, y0);
  at.Add(0, y1);
  at.Grow(0, misplacement_.y);
  const GridWindow& window = reading_.window;
  SampleBox range = AveragesIn(at);
  range.west = window.column, range.east = window.column + window.columns - 1;
  range = Clipped(range);
  if (range.empty()) return;
  band_.top = range.north, band_.bottom = range.south;
  MeasureColumns(range, band_);
}

}  // namespace terrace::dem
