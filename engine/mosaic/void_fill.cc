#include "engine/mosaic/void_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include "engine/raster/nan_heights.h"

namespace terrace::dem {
namespace {

class Filler {
 public:
  Filler(const std::vector<float>& heights, const GridWindow& wide, int max_gap)
      : heights_(heights), wide_(wide), max_gap_(max_gap) {}

  float At(std::int64_t column, std::int64_t row) const {
    return heights_[static_cast<std::size_t>(row * wide_.columns + column)];
  }

  float Bridge(std::int64_t column, std::int64_t row) const {
    struct Direction {
      int x, y, squared_step;
    };
    constexpr std::array<Direction, 4> kDirections = {{{1, 0, 1}, {0, 1, 1}, {1, 1, 2}, {1, -1, 2}}};
    double sum = 0, weights = 0;
    for (const Direction& direction : kDirections) {
      const int ahead = StepsToValid(column, row, direction.x, direction.y, max_gap_ - 1);
      if (ahead == 0) continue;
      const int behind = StepsToValid(column, row, -direction.x, -direction.y, max_gap_ - ahead);
      if (behind == 0) continue;
      const double gap = ahead + behind;
      const double a = At(column + ahead * direction.x, row + ahead * direction.y);
      const double b = At(column - behind * direction.x, row - behind * direction.y);
      const double weight = 1 / (gap * gap * direction.squared_step);
      sum += weight * (a * behind + b * ahead) / gap;
      weights += weight;
    }
    return weights > 0 ? static_cast<float>(sum / weights) : SampleRules::kVoid;
  }

 private:
  // 0: no valid sample within `most` steps.
  int StepsToValid(std::int64_t column, std::int64_t row, int x, int y, int most) const {
    // Up to the window's edge.
    std::int64_t last = most;
    if (x != 0) last = std::min(last, x > 0 ? wide_.columns - 1 - column : column);
    if (y != 0) last = std::min(last, y > 0 ? wide_.rows - 1 - row : row);
    const std::int64_t stride = y * wide_.columns + x;
    const float* sample = heights_.data() + row * wide_.columns + column;
    for (int steps = 1; steps <= last; ++steps) {
      sample += stride;
      if (!std::isnan(*sample)) return steps;
    }
    return 0;
  }

  const std::vector<float>& heights_;
  const GridWindow& wide_;
  int max_gap_;
};

// Marks the samples with a valid one within `reach` columns and rows: others cannot be bridged.
class NearValid {
 public:
  NearValid(const std::vector<float>& heights, const GridWindow& wide, int reach)
      : columns_(wide.columns), near_(heights.size()) {
    std::vector<std::uint8_t> along(heights.size());
    for (std::int64_t row = 0; row < wide.rows; ++row) {
      const std::span of_row = std::span(heights).subspan(At(0, row), static_cast<std::size_t>(columns_));
      std::int64_t last = -1 - reach;  // the last valid column
      for (std::int64_t column = 0; column < columns_; ++column) {
        if (std::isnan(of_row[static_cast<std::size_t>(column)])) continue;
        const std::int64_t first = std::max({std::int64_t{0}, column - reach, last + reach + 1});
        const std::int64_t end = std::min(column + reach + 1, columns_);
        if (first < end) std::fill_n(along.begin() + static_cast<std::ptrdiff_t>(At(first, row)), end - first, 1);
        last = column;
      }
    }
    std::vector<std::int32_t> counts(static_cast<std::size_t>(columns_));  // of marks in the rows within reach
    const auto add = [&](std::int64_t row, std::int32_t sign) {
      if (row < 0 || row >= wide.rows) return;
      for (std::int64_t c = 0; c < columns_; ++c) counts[static_cast<std::size_t>(c)] += sign * along[At(c, row)];
    };
    for (std::int64_t row = 0; row < reach; ++row) add(row, 1);
    for (std::int64_t row = 0; row < wide.rows; ++row) {
      add(row + reach, 1);
      add(row - reach - 1, -1);
      for (std::int64_t c = 0; c < columns_; ++c) near_[At(c, row)] = counts[static_cast<std::size_t>(c)] > 0 ? 1 : 0;
    }
  }

  bool Has(std::int64_t column, std::int64_t row) const { return near_[At(column, row)] != 0; }

 private:
  std::size_t At(std::int64_t column, std::int64_t row) const {
    return static_cast<std::size_t>(row * columns_ + column);
  }

  const std::int64_t columns_;
  std::vector<std::uint8_t> near_;
};

}  // namespace

std::vector<float> FillVoids(const std::vector<float>& heights, const GridWindow& wide, const GridWindow& core,
                             int max_gap) {
  const Filler filler(heights, wide, max_gap);
  const auto row_of = [&](std::int64_t row) {
    const auto first = static_cast<std::size_t>((row - wide.row) * wide.columns + core.column - wide.column);
    return std::span(heights).subspan(first, static_cast<std::size_t>(core.columns));
  };
  std::vector<std::int64_t> rows;  // with voids
  std::int64_t voids = 0;
  std::vector<float> filled;
  filled.reserve(static_cast<std::size_t>(core.columns * core.rows));
  for (std::int64_t row = core.row; row < core.row + core.rows; ++row) {
    const std::span<const float> of_row = row_of(row);
    filled.insert(filled.end(), of_row.begin(), of_row.end());
    if (!HasVoids(of_row)) continue;
    rows.push_back(row);
    voids += std::ranges::count_if(of_row, [](float height) { return std::isnan(height); });
  }
  // Marking costs about as much as bridging a 16th of the samples.
  constexpr std::int64_t kMarkingDivisor = 16;
  std::optional<NearValid> near;
  // The nearer one of a pair of samples is at most half a gap away.
  if (voids > wide.columns * wide.rows / kMarkingDivisor) near.emplace(heights, wide, max_gap / 2);
  for (const std::int64_t row : rows) {
    float* const to = filled.data() + (row - core.row) * core.columns;
    for (std::int64_t i = 0; i < core.columns; ++i) {
      const std::int64_t c = core.column - wide.column + i, r = row - wide.row;
      if (std::isnan(to[i]) && (!near || near->Has(c, r))) to[i] = filler.Bridge(c, r);
    }
  }
  return filled;
}

}  // namespace terrace::dem
