#include "engine/mosaic/harmonic_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace terrace::dem {
namespace {

// The region and the samples around it, in doubles.
class Patch {
 public:
  explicit Patch(const GridWindow& box)
      : left_(box.column - 1), top_(box.row - 1), stride_(static_cast<std::size_t>(box.columns) + 2) {
    heights_.resize(stride_ * (static_cast<std::size_t>(box.rows) + 2));
    shares_.resize(heights_.size());
  }

  std::size_t At(std::int64_t column, std::int64_t row) const {
    return static_cast<std::size_t>(row - top_) * stride_ + static_cast<std::size_t>(column - left_);
  }
  std::array<std::size_t, 4> Beside(std::size_t at) const { return {at - 1, at + 1, at - stride_, at + stride_}; }

  std::vector<double>& heights() { return heights_; }  // 0 where there is none
  std::vector<double>& shares() { return shares_; }    // one over the number of neighbours

  // Successive over-relaxation. Returns the largest change.
  double Sweep(const std::vector<std::size_t>& samples, double relaxation) {
    double largest = 0;
    double* const heights = heights_.data();
    for (const std::size_t at : samples) {
      const double mean =
          (heights[at - 1] + heights[at + 1] + (heights[at - stride_] + heights[at + stride_])) * shares_[at];
      const double change = relaxation * (mean - heights[at]);
      heights[at] += change;
      largest = std::max(largest, std::abs(change));
    }
    return largest;
  }

 private:
  std::int64_t left_, top_;
  std::size_t stride_;
  std::vector<double> heights_, shares_;
};

}  // namespace

std::vector<VoidRegion> RegionsIn(const WindowWithHoles& grid, const GridWindow& core, const OpenSides& open) {
  const GridWindow& window = grid.window;
  const std::int64_t last_column = window.column + window.columns - 1, last_row = window.row + window.rows - 1;
  std::vector<VoidRegion> regions;
  std::vector<std::uint8_t> seen(grid.unknown.size());
  const auto visit = [&](std::int64_t column, std::int64_t row, VoidRegion& region) {
    if (column < window.column || column > last_column || row < window.row || row > last_row) return;
    const std::size_t at = grid.At(column, row);
    if (grid.unknown[at] == 0 || seen[at] != 0) return;
    seen[at] = 1;
    region.samples.push_back(at);
  };
  for (std::int64_t row = core.row; row < core.row + core.rows; ++row) {
    for (std::int64_t column = core.column; column < core.column + core.columns; ++column) {
      VoidRegion region;
      visit(column, row, region);
      if (region.samples.empty()) continue;
      std::int64_t west = column, east = column, north = row, south = row;
      for (std::size_t done = 0; done < region.samples.size(); ++done) {
        const auto at = static_cast<std::int64_t>(region.samples[done]);
        const std::int64_t x = window.column + at % window.columns, y = window.row + at / window.columns;
        west = std::min(west, x), east = std::max(east, x), north = std::min(north, y), south = std::max(south, y);
        visit(x - 1, y, region), visit(x + 1, y, region), visit(x, y - 1, region), visit(x, y + 1, region);
      }
      region.box = {west, north, east - west + 1, south - north + 1};
      region.is_cut = (open.west && west == window.column) || (open.east && east == last_column) ||
                      (open.north && north == window.row) || (open.south && south == last_row);
      std::ranges::sort(region.samples);
      regions.push_back(std::move(region));
    }
  }
  return regions;
}

void SolveHarmonic(const VoidRegion& region, WindowWithHoles& grid) {
  const GridWindow& window = grid.window;
  Patch patch(region.box);
  std::vector<std::size_t> inside;
  inside.reserve(region.samples.size());
  std::vector<std::uint8_t> is_inside(patch.heights().size());
  for (const std::size_t sample : region.samples) {
    const auto at = static_cast<std::int64_t>(sample);
    inside.push_back(patch.At(window.column + at % window.columns, window.row + at / window.columns));
    is_inside[inside.back()] = 1;
  }
  // Heights beside the region are fixed. NaNs, and neighbours outside the grid, do not count.
  double sum = 0, known = 0;
  for (std::int64_t row = region.box.row - 1; row <= region.box.row + region.box.rows; ++row) {
    for (std::int64_t column = region.box.column - 1; column <= region.box.column + region.box.columns; ++column) {
      if (column < window.column || column >= window.column + window.columns || row < window.row ||
          row >= window.row + window.rows) {
        continue;
      }
      const std::size_t at = grid.At(column, row);
      if (grid.unknown[at] != 0 || std::isnan(grid.heights[at])) continue;
      patch.heights()[patch.At(column, row)] = grid.heights[at];
      is_inside[patch.At(column, row)] = 2;
    }
  }
  for (const std::size_t at : inside) {
    int neighbours = 0;
    for (const std::size_t beside : patch.Beside(at)) {
      neighbours += is_inside[beside] != 0;
      if (is_inside[beside] != 2) continue;
      sum += patch.heights()[beside];
      ++known;
    }
    patch.shares()[at] = neighbours == 0 ? 0 : 1.0 / neighbours;
  }
  if (known == 0) {
    for (const std::size_t sample : region.samples) grid.heights[sample] = SampleRules::kVoid;
    return;
  }
  for (const std::size_t at : inside) patch.heights()[at] = sum / known;
  // The best relaxation factor for a square of this size. At worst, changes decrease by one in a few hundred per sweep,
  // so the remaining error is a hundredth of the rounding of heights.
  constexpr double kSmallest = 1e-7;
  const auto side = static_cast<double>(std::max(region.box.columns, region.box.rows));
  const double relaxation = 2 / (1 + std::numbers::pi / (side + 1));
  const int most = 16 * static_cast<int>(side) + 64;
  for (int i = 0; i < most && patch.Sweep(inside, relaxation) > kSmallest; ++i) {
  }
  for (std::size_t i = 0; i < inside.size(); ++i) {
    grid.heights[region.samples[i]] = static_cast<float>(patch.heights()[inside[i]]);
  }
}

void RelaxHarmonic(const std::vector<std::size_t>& samples, WindowWithHoles& grid) {
  const GridWindow& window = grid.window;
  constexpr double kDamping = 0.8;  // also damps errors that alternate between samples
  std::vector<double> before(samples.size());
  std::vector<double> heights(grid.heights.begin(), grid.heights.end());
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::size_t at = samples[i];
      const auto column = static_cast<std::int64_t>(at) % window.columns,
                 row = static_cast<std::int64_t>(at) / window.columns;
      const auto stride = static_cast<std::size_t>(window.columns);
      double sum = 0, count = 0;
      const auto add = [&](bool is_there, std::size_t beside) {
        if (!is_there || std::isnan(heights[beside])) return;
        sum += heights[beside];
        ++count;
      };
      add(column > 0, at - 1);
      add(column + 1 < window.columns, at + 1);
      add(row > 0, at - stride);
      add(row + 1 < window.rows, at + stride);
      before[i] =
          count == 0 || std::isnan(heights[at]) ? heights[at] : heights[at] + kDamping * (sum / count - heights[at]);
    }
    for (std::size_t i = 0; i < samples.size(); ++i) heights[samples[i]] = before[i];
  }
  for (const std::size_t at : samples) grid.heights[at] = static_cast<float>(heights[at]);
}

}  // namespace terrace::dem
