#include "engine/dem/bound/cell_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {

CellSurface::CellSurface(const std::array<Position, 4>& corners, bool is_separable, const Position& slack)
    : origin_(corners[0]),
      east_{corners[1].x - origin_.x, corners[1].y - origin_.y},
      north_{corners[2].x - origin_.x, corners[2].y - origin_.y},
      twist_{corners[3].x - corners[1].x - north_.x, corners[3].y - corners[1].y - north_.y} {
  // Lines between nodes deviate from straight lines by much less than this fraction of the cell.
  constexpr double kBulge = 1.0 / 32;
  const double bulge = is_separable ? 0 : kBulge;
  const auto extent = [](double east, double north, double twist) {
    return std::abs(east) + std::abs(north) + std::abs(twist);
  };
  slack_x_ = bulge * extent(east_.x, north_.x, twist_.x) + slack.x;
  slack_y_ = bulge * extent(east_.y, north_.y, twist_.y) + slack.y;
}

double CellSurface::Apart(const Position& at, double sample) const {
  double u = 0.5, v = 0.5, u_slack = std::numeric_limits<double>::infinity(), v_slack = u_slack;
  constexpr int kSteps = 4;
  for (int step = 0; step < kSteps; ++step) {
    const double right_x = at.x - origin_.x - u * east_.x - v * north_.x - u * v * twist_.x;
    const double right_y = at.y - origin_.y - u * east_.y - v * north_.y - u * v * twist_.y;
    const double ux = east_.x + v * twist_.x, uy = east_.y + v * twist_.y;
    const double vx = north_.x + u * twist_.x, vy = north_.y + u * twist_.y;
    const double scale = 1 / std::abs(ux * vy - uy * vx);
    const double sign = ux * vy - uy * vx < 0 ? -scale : scale;
    u += (right_x * vy - right_y * vx) * sign;
    v += (ux * right_y - uy * right_x) * sign;
    // The remaining error is much smaller than the last step.
    const double x = slack_x_ + (step + 1 < kSteps ? 0 : std::abs(right_x));
    const double y = slack_y_ + (step + 1 < kSteps ? 0 : std::abs(right_y));
    u_slack = (std::abs(vy) * x + std::abs(vx) * y) * scale;
    v_slack = (std::abs(uy) * x + std::abs(ux) * y) * scale;
  }
  const auto [lowest, highest] = std::minmax_element(heights_.begin(), heights_.end());
  const double anywhere = std::max(*highest - sample, sample - *lowest) + widened_;
  if (!(u_slack < 1 && v_slack < 1)) return anywhere;  // also where it did not converge
  if (u < -u_slack || u > 1 + u_slack || v < -v_slack || v > 1 + v_slack) return 0;
  const double south = heights_[0] + u * (heights_[1] - heights_[0]);
  const double north = heights_[2] + u * (heights_[3] - heights_[2]);
  const double along = std::max(std::abs(heights_[1] - heights_[0]), std::abs(heights_[3] - heights_[2]));
  const double across = std::max(std::abs(heights_[2] - heights_[0]), std::abs(heights_[3] - heights_[1]));
  // Within the slack outside the cell, slopes differ from the cell's only by the twist: twice the slope is enough.
  const double here = std::abs(south + v * (north - south) - sample) + 2 * (u_slack * along + v_slack * across);
  return std::min(anywhere, here + widened_);
}

}  // namespace terrace::dem
