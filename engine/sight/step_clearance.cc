#include "engine/sight/step_clearance.h"

#include <cmath>
#include <limits>

namespace terrace::dem {

double LeastClearance(const SampleView& samples, const RayPlace& from, const RayPlace& to) {
  const double dx = to.x - from.x, dy = to.y - from.y, rise_m = to.height_m - from.height_m;
  const std::int64_t column = samples.ColumnOf(from.x), row = samples.RowOf(from.y);
  const std::int64_t to_column = samples.ColumnOf(to.x), to_row = samples.RowOf(to.y);
  // Where it crosses a line of samples on each axis.
  const double at_x = to_column == column ? 1 : (static_cast<double>(std::max(column, to_column)) - from.x) / dx;
  const double at_y = to_row == row ? 1 : (static_cast<double>(std::max(row, to_row)) - from.y) / dy;
  double least_m = std::numeric_limits<double>::infinity(), before_m = 0, before = -1;
  const auto add = [&](std::int64_t cell_column, std::int64_t cell_row, double share) {
    const float* const corner = samples.heights + cell_row * samples.stride + cell_column;
    const double nw = corner[0], ne = corner[1], sw = corner[samples.stride], se = corner[samples.stride + 1];
    const double twist = nw - ne - sw + se;
    const double west = from.x - static_cast<double>(cell_column), north = from.y - static_cast<double>(cell_row);
    const auto clearance = [&](double t) {
      const double east_of = west + t * dx, south_of = north + t * dy;
      return from.height_m + t * rise_m -
             (nw + east_of * (ne - nw) + south_of * (sw - nw) + east_of * south_of * twist);
    };
    if (before < 0) before_m = clearance(0), before = 0;
    const double after_m = clearance(share), way = share - before;
    least_m = std::min(least_m, std::min(before_m, after_m) - std::abs(twist * dx * dy) * way * way / 4);
    before_m = after_m, before = share;
  };
  const bool is_x_first = at_x <= at_y;
  add(column, row, std::min(at_x, at_y));
  if (before < 1) add(is_x_first ? to_column : column, is_x_first ? row : to_row, std::max(at_x, at_y));
  if (before < 1) add(to_column, to_row, 1);
  return least_m;
}

}  // namespace terrace::dem
