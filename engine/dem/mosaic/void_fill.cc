#include "engine/dem/mosaic/void_fill.h"

#include <array>
#include <cmath>

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
    for (int steps = 1; steps <= most; ++steps) {
      column += x;
      row += y;
      if (column < 0 || column >= wide_.columns || row < 0 || row >= wide_.rows) return 0;
      if (!std::isnan(At(column, row))) return steps;
    }
    return 0;
  }

  const std::vector<float>& heights_;
  const GridWindow& wide_;
  int max_gap_;
};

}  // namespace

std::vector<float> FillVoids(const std::vector<float>& heights, const GridWindow& wide, const GridWindow& core,
                             int max_gap) {
  const Filler filler(heights, wide, max_gap);
  std::vector<float> filled;
  filled.reserve(static_cast<std::size_t>(core.columns * core.rows));
  for (std::int64_t r = core.row - wide.row; r < core.row - wide.row + core.rows; ++r) {
    for (std::int64_t c = core.column - wide.column; c < core.column - wide.column + core.columns; ++c) {
      const float height = filler.At(c, r);
      filled.push_back(std::isnan(height) ? filler.Bridge(c, r) : height);
    }
  }
  return filled;
}

}  // namespace terrace::dem
