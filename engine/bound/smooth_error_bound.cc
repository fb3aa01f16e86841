#include "engine/bound/smooth_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/raster/grid_cells.h"
#include "engine/raster/nan_heights.h"

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
      misplacement_{statistics.misplacement().x / reading.factor, statistics.misplacement().y / reading.factor},
      is_even_around_(grid.wraps() && grid.columns() % reading.factor == 0) {
  const auto last = [&](int samples) {
    const GridAxis axis(samples, reading.factor, false);
    return static_cast<double>(axis.count() - (samples % reading.factor == 0 ? 1 : 2));
  };
  last_ = {last(grid.columns()) - misplacement_.x, last(grid.rows()) - misplacement_.y};
  if (reading.cells.is_separable()) PlaceColumnsAndRows();
}

// Averages are not evenly spaced at the end of an axis whose last average covers fewer samples. Beyond the outermost
// averages, where the surface is constant, all places are those of the averages: the steps between places change there,
// which counts as a bend.
double SmoothErrorBound::EvenColumn(std::int64_t column, double weight) const {
  const double x = static_cast<double>(column) + weight;
  return is_even_around_ || (x >= 0 && x <= last_.x) ? x : kUnknown;
}

double SmoothErrorBound::EvenRow(std::int64_t row, double weight) const {
  const double y = static_cast<double>(row) + weight;
  return y >= 0 && y <= last_.y ? y : kUnknown;
}

void SmoothErrorBound::PlaceColumnsAndRows() {
  const NodeCells& cells = reading_.cells;
  const NodeWindow& part = cells.window();  // nodes beyond have no height from this raster grid
  x_.assign(tile_.stride(), kUnknown);
  y_.assign(static_cast<std::size_t>(tile_.window.rows), kUnknown);
  double* const x = x_.data() + (part.column - tile_.window.column);
  double* const y = y_.data() + (part.row - tile_.window.row);
  for (std::size_t i = 0; i < cells.columns().size(); ++i) {
    x[i] = EvenColumn(cells.columns()[i].index, cells.columns()[i].weight);
  }
  for (std::size_t j = 0; j < cells.rows().size(); ++j) {
    y[j] = EvenRow(cells.rows()[j].index, cells.rows()[j].weight);
  }
}

// The place of a node of the tile's window, in averages; NaN if it is not regular.
Position SmoothErrorBound::PlaceOf(std::size_t i, std::size_t j) const {
  if (std::isnan(reading_.heights[j * tile_.stride() + i])) return kNowhere;
  if (reading_.cells.is_separable()) return {x_[i], y_[j]};
  const GridCell cell = reading_.cells.OfNode(tile_.window.column + static_cast<std::int64_t>(i),
                                              tile_.window.row + static_cast<std::int64_t>(j));
  return {EvenColumn(cell.column, cell.x), EvenRow(cell.row, cell.y)};
}

// Returns false if one of the nodes `first` to `end` of a row of the tile's window has no height from this raster grid.
bool SmoothErrorBound::GaveHeights(std::size_t row, std::size_t first, std::size_t end) const {
  return !HasVoids(std::span(reading_.heights).subspan(row * tile_.stride() + first, end - first));
}

// The same for the nodes of a box and their neighbours.
bool SmoothErrorBound::GaveHeights(const CellBox& box) const {
  if (box.south >= known_south_ && box.north <= known_north_) return true;
  const auto west = static_cast<std::size_t>(box.west + 1), south = static_cast<std::size_t>(box.south + 1);
  const auto east = static_cast<std::size_t>(box.east + 1), north = static_cast<std::size_t>(box.north + 1);
  if (!GaveHeights(south - 1, west, east + 1) || !GaveHeights(north + 1, west, east + 1)) return false;
  for (std::size_t j = south; j <= north; ++j) {
    if (!GaveHeights(j, west - 1, east + 2)) return false;
  }
  return true;
}

PixelBounds SmoothErrorBound::BoundsOf(const CellBox& box) const {
  PixelBounds bounds;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const Position place = PlaceOf(static_cast<std::size_t>(i + 1), static_cast<std::size_t>(j + 1));
      if (std::isnan(place.x + place.y)) return {};
      bounds.Add(place.x, place.y);
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
  if (!GaveHeights(box)) return false;
  if (!(reading_.cells.is_separable() ? MeasureAxes(box, steps, at) : MeasureNodes(box, steps, at))) return false;
  // A line with second difference b deviates from its chord by b / 8, and half as much again covers changes of b in
  // both directions. At the outermost averages places stop between two nodes: a part a of a step of length s is lost,
  // the steps differ by a or by s - a, and a place is at most a (s - a) / s, half of the larger one, off the chord.
  constexpr double kOffChord = 0.5;
  steps.bend_x = steps.bend_x * kOffChord + position_error_ + misplacement_.x;
  steps.bend_y = steps.bend_y * kOffChord + position_error_ + misplacement_.y;
  at.Grow(misplacement_.x, misplacement_.y);
  return true;
}

bool SmoothErrorBound::MeasureNodes(const CellBox& box, NodeSteps& steps, PixelBounds& at) const {
  const int columns = box.east - box.west, rows = box.north - box.south;
  const NodePositions& positions = reading_.cells.positions();
  if (!reading_.cells.axes().columns.wraps()) {
    const auto [column, row] = tile_.GlobalNode(tile_.Cell(box.west, box.south), 0);
    const auto i = static_cast<std::size_t>(column - positions.window().column);
    const auto j = static_cast<std::size_t>(row - positions.window().row);
    NodeSteps pixels;
    PixelBounds in_pixels;
    if (!MeasureSteps(&positions.Row(j)[i], positions.columns(), columns, rows, pixels, in_pixels)) return false;
    // `factor` is a power of two: only the difference is rounded.
    const double per_factor = 1.0 / reading_.factor;
    steps = {pixels.east_x * per_factor,  pixels.east_y * per_factor, pixels.north_x * per_factor,
             pixels.north_y * per_factor, pixels.bend_x * per_factor, pixels.bend_y * per_factor};
    at = {in_pixels.west * per_factor - 0.5, in_pixels.east * per_factor - 0.5, in_pixels.north * per_factor - 0.5,
          in_pixels.south * per_factor - 0.5};
    // The neighbours of the box are one step away, which differs from the steps of the box by no more than the bend.
    const double reach_x = std::max(steps.east_x, steps.north_x) + steps.bend_x;
    const double reach_y = std::max(steps.east_y, steps.north_y) + steps.bend_y;
    const bool are_even = at.west - reach_x >= 0 && at.east + reach_x <= last_.x && at.north - reach_y >= 0 &&
                          at.south + reach_y <= last_.y;
    if (are_even) return true;
  }
  std::vector<Position> places;
  const auto stride = static_cast<std::size_t>(columns + 3);
  for (int j = box.south; j <= box.north + 2; ++j) {
    for (int i = box.west; i <= box.east + 2; ++i) {
      places.push_back(PlaceOf(static_cast<std::size_t>(i), static_cast<std::size_t>(j)));
    }
  }
  steps = {}, at = {};
  return MeasureSteps(&places[stride + 1], stride, columns, rows, steps, at);
}

// Columns of nodes run along columns of samples, rows along rows: each step has one axis.
bool SmoothErrorBound::MeasureAxes(const CellBox& box, NodeSteps& steps, PixelBounds& at) const {
  const auto west = static_cast<std::size_t>(box.west + 1), south = static_cast<std::size_t>(box.south + 1);
  const auto east = static_cast<std::size_t>(box.east + 1), north = static_cast<std::size_t>(box.north + 1);
  double finite = 0;  // becomes NaN if a place is
  const auto measure = [&](const double* places, std::size_t first, std::size_t last, double& step, double& bend) {
    for (std::size_t k = first; k <= last; ++k) {
      const double after = places[k + 1] - places[k], before = places[k] - places[k - 1];
      finite += after + before;
      if (k < last) step = std::max(step, std::abs(after));
      bend = std::max(bend, std::abs(after - before));
    }
  };
  measure(x_.data(), west, east, steps.east_x, steps.bend_x);
  measure(y_.data(), south, north, steps.north_y, steps.bend_y);
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
  const auto rows = static_cast<std::size_t>(north - south + 3);
  const auto nodes = std::span(reading_.heights).subspan(static_cast<std::size_t>(south) * tile_.stride());
  const bool are_known = !HasVoids(nodes.first(rows * tile_.stride()));
  known_south_ = are_known ? south : 0;
  known_north_ = are_known ? north : -1;
  if (!reading_.cells.is_separable() || reading_.samples.empty()) return;
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
