#include "engine/statistics/averaging_errors.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/common/dem_types.h"

namespace terrace::dem {

AveragingErrors::AveragingErrors(int width, int height) {
  for (int factor = 2;; factor *= 2) {
    const auto blocks = [&](int pixels) { return (pixels + BlockPixels(factor) - 1) / BlockPixels(factor); };
    Level level{blocks(width), blocks(height), {}};
    level.errors.resize(Area(level.columns, level.rows));
    levels_.push_back(std::move(level));
    if (factor >= std::max(width, height)) return;
  }
}

std::size_t AveragingErrors::IndexOf(int factor) const {
  const int index = std::bit_width(static_cast<unsigned>(factor)) - 2;
  return std::min(static_cast<std::size_t>(index), levels_.size() - 1);
}

float AveragingErrors::Largest(int factor, double west, double north, double east, double south) const {
  if (factor < 2) return 0;
  factor = std::min(factor, largest_factor());
  const Level& level = levels_[IndexOf(factor)];
  const double pixels = BlockPixels(factor);
  const auto block = [&](double position, int count) {
    return static_cast<int>(std::clamp(std::floor(position / pixels), 0.0, count - 1.0));
  };
  float largest = 0;
  for (int row = block(north, level.rows); row <= block(south, level.rows); ++row) {
    for (int column = block(west, level.columns); column <= block(east, level.columns); ++column) {
      largest = std::max(largest, level.errors[IndexAt(column, row, level.columns)]);
    }
  }
  return largest;
}

}  // namespace terrace::dem
