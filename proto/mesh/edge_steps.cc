#include "proto/mesh/edge_steps.h"

#include <algorithm>
#include <cmath>

namespace terrace::proto {
namespace {

double PowerOfTwoAtLeast(double value) {
  const double below = PowerOfTwoAtMost(value);
  return below == value ? below : 2 * below;
}

}  // namespace

double EdgeSteps::Coarsest(tin::Side which) const {
  const auto index = static_cast<std::size_t>(which);
  // Sides are in the order south, east, north, west: side k runs from corner k to corner k + 1.
  return std::max({side[index], corner[index], corner[(index + 1) % 4]});
}

double PowerOfTwoAtMost(double value) { return std::ldexp(1.0, std::ilogb(value)); }

double NeededStep(double min_height, double max_height) {
  return PowerOfTwoAtLeast(std::max((max_height - min_height) / 16384, kHeightResolution));
}

EdgeSteps MakeEdgeSteps(const EdgeErrors& errors, const std::array<std::array<double, 3>, 3>& needed, double pole_step,
                        bool at_south_pole, bool at_north_pole) {
  const double requested = std::max(PowerOfTwoAtMost(errors.tile / 8), kHeightResolution);
  const auto over = [&](double error_m, int row_from, int row_to, int column_from, int column_to) {
    double step = requested;
    if (error_m < errors.tile) {
      step = std::max({PowerOfTwoAtMost(error_m / 8), requested / 8192, kHeightResolution});
    }
    for (int row = row_from; row <= row_to; ++row) {
      if ((row == 0 && at_south_pole) || (row == 2 && at_north_pole)) {
        step = std::max(step, pole_step);
        continue;
      }
      for (int column = column_from; column <= column_to; ++column) {
        step = std::max(step, needed[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]);
      }
    }
    return step;
  };
  EdgeSteps steps;
  const auto& [tile, side, corner] = errors;
  steps.side = {over(side[0], 0, 1, 1, 1), over(side[1], 1, 1, 1, 2), over(side[2], 1, 2, 1, 1),
                over(side[3], 1, 1, 0, 1)};
  steps.corner = {over(corner[0], 0, 1, 0, 1), over(corner[1], 0, 1, 1, 2), over(corner[2], 1, 2, 1, 2),
                  over(corner[3], 1, 2, 0, 1)};
  // A pole is one point: its samples in all tiles have the same step.
  const double pole = std::max(requested, pole_step);
  if (at_south_pole) steps.side[0] = steps.corner[0] = steps.corner[1] = pole;
  if (at_north_pole) steps.side[2] = steps.corner[2] = steps.corner[3] = pole;
  return steps;
}

double StepAt(const EdgeSteps& steps, int x, int y, int cells) {
  const bool south = y == 0, east = x == cells, north = y == cells, west = x == 0;
  if (south && west) return steps.corner[0];
  if (south && east) return steps.corner[1];
  if (north && east) return steps.corner[2];
  if (north && west) return steps.corner[3];
  if (south) return steps.side[0];
  if (east) return steps.side[1];
  if (north) return steps.side[2];
  if (west) return steps.side[3];
  return 0;
}

double SnapHeight(double height, double step) { return std::floor(height / step + 0.5) * step; }

}  // namespace terrace::proto
