#include "engine/dem/geoid_gap.h"

#include <algorithm>
#include <cmath>

namespace terrace::dem {

// A geoid is bilinear on a grid of its own. Where that is coarser than the lattice, a step between nodes crosses one
// of its lines at most. There the chord is off by at most a quarter of the step times the change of slope, and the
// larger second difference at the ends of the step is at least half of that product: half a second difference for
// each axis. The whole is taken, as the change of slope varies along the line.
double GeoidGap::Over(const CellBox& box) const {
  if (geoid_ == nullptr) return 0;
  // The finest grids in use have cells of half a minute.
  constexpr double kFinestGeoid = 1.0 / 120;
  if (tile_.lattice.StepDegrees() > kFinestGeoid / 2) return OverCoarse(box);
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
  if (!std::isfinite(sum)) return kUnknownGap;
  return 2 * Undulations::kTolerance + xx + yy + xy;
}

// By bounds on the geoid around each cell.
double GeoidGap::OverCoarse(const CellBox& box) const {
  double gap = 0;
  for (int j = box.south; j < box.north; ++j) {
    for (int i = box.west; i < box.east; ++i) {
      const HeightRange range = RangeOf({i, j, i + 1, j + 1});
      for (const std::size_t node : tile_.Cell(i, j).nodes) {
        const double geoid = added_[node];
        if (std::isnan(geoid)) return kUnknownGap;
        gap = std::max({gap, range.max - geoid, geoid - range.min});
      }
    }
  }
  return gap + Undulations::kTolerance;
}

}  // namespace terrace::dem
