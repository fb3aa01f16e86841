#include "engine/dem/bound/smooth_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace terrace::dem {
namespace {

// A function that is linear between samples one apart, with second differences of at most 1, strays from its chord over
// `length` samples by at most this: at most one kink on less than a sample; (length^2 + 1) / 8 with more.
double ChordError(double length) { return length < 1 ? length / 4 : (length * length + 1) / 8; }

// Several running values instead of one: no step waits for the one before it, and the compiler puts them side by side.
class Lanes {
 public:
  // The largest |value(i)| for i in 0 .. count - 1; NaN is left out.
  template <typename Value>
  void Raise(std::size_t count, const Value& value) {
    ForEach(count, [&](std::size_t lane, std::size_t i) {
      const float size = std::abs(value(i));
      lanes_[lane] = size > lanes_[lane] ? size : lanes_[lane];
    });
  }
  template <typename Value>
  void Add(std::size_t count, const Value& value) {
    ForEach(count, [&](std::size_t lane, std::size_t i) { lanes_[lane] += value(i); });
  }
  float Largest() const { return *std::ranges::max_element(lanes_); }
  float Sum() const { return std::accumulate(lanes_.begin(), lanes_.end(), 0.0f); }

 private:
  static constexpr std::size_t kLanes = 8;

  template <typename Step>
  static void ForEach(std::size_t count, const Step& step) {
    std::size_t i = 0;
    for (; i + kLanes <= count; i += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) step(lane, i + lane);
    }
    for (; i < count; ++i) step(i % kLanes, i);
  }

  std::array<float, kLanes> lanes_{};
};

}  // namespace

SmoothErrorBound::SmoothErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridTrace& trace,
                                   const GridTables& tables, const GeoidErrorBound& geoid, bool blends)
    : tile_(tile),
      trace_(trace),
      tables_(tables),
      geoid_(geoid),
      blends_(blends),
      misplacement_{tables.misplacement().x / trace.factor, tables.misplacement().y / trace.factor} {
  PlaceNodes(grid);
}

// Nodes that took their height from this raster grid, away from its rim: where the surface ends, and where the last
// average of an axis stands for fewer samples, it is no even grid.
void SmoothErrorBound::PlaceNodes(const RasterGrid& grid) {
  constexpr double kNowhereNear = std::numeric_limits<double>::quiet_NaN();
  x_.assign(trace_.positions.size(), kNowhereNear);
  y_ = x_;
  const GridAxis columns(grid.columns(), trace_.factor, grid.wraps()), rows(grid.rows(), trace_.factor, false);
  const auto last = [&](const GridAxis& axis, int samples) {
    return static_cast<double>(axis.count() - (samples % trace_.factor == 0 ? 1 : 2));
  };
  const double last_x = last(columns, grid.columns()) - misplacement_.x;
  const double last_y = last(rows, grid.rows()) - misplacement_.y;
  for (std::size_t n = 0; n < x_.size(); ++n) {
    const std::int32_t at = trace_.cell_of_node[n];
    if (at < 0) continue;
    const GridCell& cell = trace_.cells[static_cast<std::size_t>(at)];
    const double x = static_cast<double>(cell.column) + cell.x, y = static_cast<double>(cell.row) + cell.y;
    const bool even_x =
        grid.wraps() ? grid.columns() % trace_.factor == 0 || (x >= 0 && x <= last_x) : x > 0 && x < last_x;
    if (!even_x || !(y > 0 && y < last_y)) continue;
    x_[n] = x;
    y_[n] = y;
  }
}

PixelBounds SmoothErrorBound::BoundsOf(const CellBox& box) const {
  PixelBounds bounds;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const std::size_t n = tile_.NodeOf(i, j);
      if (std::isnan(x_[n])) return {};
      bounds.Add(x_[n], y_[n]);
    }
  }
  return bounds;
}

double SmoothErrorBound::Largest(const Bends& bends, const Steps& steps) {
  const auto along = [&](double x, double y) {
    return ChordError(x) * bends.xx + ChordError(y) * bends.yy + x * y * bends.xy / 4;
  };
  return along(steps.east_x, steps.east_y) + along(steps.north_x, steps.north_y) + steps.bend_x * bends.x +
         steps.bend_y * bends.y;
}

// Between the heights served and the raster grid's own, at the nodes of a box.
double SmoothErrorBound::LargestBlend(const CellBox& box) const {
  if (!blends_) return 0;
  float largest = 0;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= box.east; ++i) {
      const std::size_t n = tile_.NodeOf(i, j);
      largest = std::max(largest, std::abs(tile_.heights[n] - trace_.heights[n]));
    }
  }
  return largest;
}

bool SmoothErrorBound::Measure(const CellBox& box, Steps& steps, PixelBounds& at) const {
  const std::size_t stride = tile_.stride();
  double finite = 0;  // becomes NaN with any position
  const auto raise = [](double& largest, double value) { largest = std::max(largest, std::abs(value)); };
  for (int j = box.south; j <= box.north; ++j) {
    std::size_t n = tile_.NodeOf(box.west, j);
    for (int i = box.west; i <= box.east; ++i, ++n) {
      const double x = x_[n], y = y_[n];
      const double east_x = x_[n + 1] - x, east_y = y_[n + 1] - y;
      const double north_x = x_[n + stride] - x, north_y = y_[n + stride] - y;
      const double west_x = x - x_[n - 1], west_y = y - y_[n - 1];
      const double south_x = x - x_[n - stride], south_y = y - y_[n - stride];
      finite += east_x + north_x + west_x + south_x;
      raise(steps.east_x, i < box.east ? east_x : 0);
      raise(steps.east_y, i < box.east ? east_y : 0);
      raise(steps.north_x, j < box.north ? north_x : 0);
      raise(steps.north_y, j < box.north ? north_y : 0);
      steps.bend_x = std::max({steps.bend_x, std::abs(east_x - west_x), std::abs(north_x - south_x)});
      steps.bend_y = std::max({steps.bend_y, std::abs(east_y - west_y), std::abs(north_y - south_y)});
      at.Add(x, y);
    }
  }
  if (!std::isfinite(finite)) return false;
  // A line that bends by b per step is off its chord by b / 8; half as much again for how the bend itself changes, in
  // both directions. Positions are known to a hundred-thousandth, those of samples to their misplacement.
  constexpr double kOffChord = 1.5 * 2 / 8, kPosition = 4e-5;
  steps.bend_x = steps.bend_x * kOffChord + kPosition + misplacement_.x;
  steps.bend_y = steps.bend_y * kOffChord + kPosition + misplacement_.y;
  at.Grow(misplacement_.x, misplacement_.y);
  return true;
}

double SmoothErrorBound::Over(const CellBox& box) const {
  constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
  Steps steps;
  PixelBounds at;
  if (!Measure(box, steps, at)) return kNowhere;
  Bends bends;
  const auto left = static_cast<std::int64_t>(std::floor(at.west)),
             right = static_cast<std::int64_t>(std::floor(at.east)) + 1;
  const auto top = static_cast<std::int64_t>(std::floor(at.north)),
             bottom = static_cast<std::int64_t>(std::floor(at.south)) + 1;
  if (!Measure(left, top, right, bottom, bends)) return kNowhere;
  return Largest(bends, steps) + geoid_.Over(box) + LargestBlend(box) +
         tables_.AveragingError(static_cast<double>(left), static_cast<double>(top), static_cast<double>(right),
                                static_cast<double>(bottom));
}

bool SmoothErrorBound::Measure(std::int64_t left, std::int64_t top, std::int64_t right, std::int64_t bottom,
                               Bends& bends) const {
  const GridWindow& window = trace_.window;
  // Beyond the outermost averages the surface goes on as it ends.
  left = std::max(left, window.column);
  top = std::max(top, window.row);
  right = std::min(right, window.column + window.columns - 1);
  bottom = std::min(bottom, window.row + window.rows - 1);
  const auto columns = static_cast<std::size_t>(right - left + 1);
  const auto stride = static_cast<std::size_t>(window.columns);
  Lanes x, y, xx, yy, xy, sum;
  for (std::int64_t row = top; row <= bottom; ++row) {
    const float* here = trace_.samples.data() + (row - window.row) * window.columns + (left - window.column);
    sum.Add(columns, [&](std::size_t c) { return here[c]; });
    x.Raise(columns - 1, [&](std::size_t c) { return here[c + 1] - here[c]; });
    if (columns > 2) {
      xx.Raise(columns - 2, [&](std::size_t c) { return here[c + 2] - here[c + 1] - (here[c + 1] - here[c]); });
    }
    if (row == bottom) break;
    const float* below = here + stride;
    y.Raise(columns, [&](std::size_t c) { return below[c] - here[c]; });
    xy.Raise(columns - 1, [&](std::size_t c) { return here[c + 1] - here[c] - (below[c + 1] - below[c]); });
    if (row == top) continue;
    const float* above = here - stride;
    yy.Raise(columns, [&](std::size_t c) { return below[c] - here[c] - (here[c] - above[c]); });
  }
  constexpr double kUp = 1 + 1e-6;  // of differences of floats
  bends = {x.Largest() * kUp, y.Largest() * kUp, xx.Largest() * kUp, yy.Largest() * kUp, xy.Largest() * kUp};
  return std::isfinite(sum.Sum());
}

}  // namespace terrace::dem
