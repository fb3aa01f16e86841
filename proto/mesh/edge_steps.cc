#include "proto/mesh/edge_steps.h"

#include <algorithm>
#include <cmath>

namespace terrace::proto {
namespace {

// Largest power of two that is at most `value` > 0.
double PowerOfTwoAtMost(double value) { return std::ldexp(1.0, std::ilogb(value)); }

double PowerOfTwoAtLeast(double value) {
  const double below = PowerOfTwoAtMost(value);
  return below == value ? below : 2 * below;
}

}  // namespace

double EdgeSteps::Coarsest(tin::Side which) const {
  const auto index = static_cast<std::size_t>(which);
  // A side's corners in the south-west, south-east, north-east, north-west order: side k runs from corner k to k + 1,
  // south, east, north, west.
  return std::max({side[index], corner[index], corner[(index + 1) % 4]});
}

double NeededStep(double min_height, double max_height) {
  return PowerOfTwoAtLeast(std::max((max_height - min_height) / 16384, kHeightResolution));
}

EdgeSteps MakeEdgeSteps(double error_m, const std::array<std::array<double, 3>, 3>& needed, double pole_step,
                        bool at_south_pole, bool at_north_pole) {
  const double requested = std::max(PowerOfTwoAtMost(error_m / 8), kHeightResolution);
  const auto over = [&](int row_from, int row_to, int column_from, int column_to) {
    double step = requested;
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
  steps.side = {over(0, 1, 1, 1), over(1, 1, 1, 2), over(1, 2, 1, 1), over(1, 1, 0, 1)};
  steps.corner = {over(0, 1, 0, 1), over(0, 1, 1, 2), over(1, 2, 1, 2), over(1, 2, 0, 1)};
  // A pole is one point: its samples in all tiles have the same step.
  const double pole = std::max(requested, pole_step);
  if (at_south_pole) steps.side[0] = steps.corner[0] = steps.corner[1] = pole;
  if (at_north_pole) steps.side[2] = steps.corner[2] = steps.corner[3] = pole;
  return steps;
}

double SnapHeight(double height, double step) { return std::floor(height / step + 0.5) * step; }

}  // namespace terrace::proto
