#include "engine/bound/grid_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

// Up to this number, members are checked one by one; for more, the index is used.
constexpr std::size_t kFewMembers = 8;

}  // namespace

GridStatistics::GridStatistics(const RasterGrid& grid, const GridReading& reading)
    : grid_(grid),
      reading_(reading),
      turn_(grid.georeference().period()),
      around_(BoxAround()),
      near_(MembersAround()) {
  for (const std::size_t i : near_) {
    const Position& off = grid.members()[i].misplacement;
    misplacement_ = {std::max(misplacement_.x, off.x), std::max(misplacement_.y, off.y)};
  }
  if (near_.size() > kFewMembers) return;
  for (const std::size_t i : near_) statistics_.push_back(grid.members()[i].raster->statistics());
}

// Columns of grids around the Earth jump by one turn somewhere. They are followed from node to node, which are less
// than half a turn apart. Nodes without a position are far from the raster grid and need no ranges.
Box GridStatistics::BoxAround() const {
  Box hull{1e300, 1e300, -1e300, -1e300};
  if (grid_.members().size() == 1) return hull;  // near members are not needed
  const NodePositions& positions = reading_.cells.positions();
  // For separable nodes, the first row and the first column represent all others.
  const bool is_separable = positions.is_separable();
  double of_row = grid_.columns() / 2.0;
  for (std::size_t j = 0; j < positions.rows(); ++j) {
    double last = of_row;
    for (std::size_t i = 0; i < positions.columns() && (i == 0 || j == 0 || !is_separable); ++i) {
      const Position p = positions.At(i, j);
      if (!std::isfinite(p.x) || !std::isfinite(p.y)) continue;
      double x = p.x;
      if (std::abs(x - last) > turn_ / 2 && turn_ > 0) x += turn_ * std::round((last - x) / turn_);
      if (i == 0) of_row = x;
      last = x;
      hull = {std::min(hull.min_x, x), std::min(hull.min_y, p.y), std::max(hull.max_x, x), std::max(hull.max_y, p.y)};
    }
  }
  const double halo = 4.0 * reading_.factor;
  return {hull.min_x - halo, hull.min_y - halo, hull.max_x + halo, hull.max_y + halo};
}

std::vector<std::size_t> GridStatistics::MembersAround() const {
  if (grid_.members().size() == 1) return {0};
  std::vector<std::size_t> members;
  for (const double turns : {0, -1, 1}) {
    if (turns != 0 && turn_ == 0) break;
    const double shift = turns * turn_;
    const auto here = grid_.MembersAt({around_.min_x + shift, around_.min_y, around_.max_x + shift, around_.max_y});
    members.insert(members.end(), here.begin(), here.end());
  }
  std::ranges::sort(members);
  members.erase(std::unique(members.begin(), members.end()), members.end());
  return members;
}

bool GridStatistics::IsAround(const Box& pixels) const {
  const double middle = (around_.min_x + around_.max_x) / 2;
  const double shift = turn_ > 0 ? turn_ * std::round((middle - (pixels.min_x + pixels.max_x) / 2) / turn_) : 0;
  return pixels.min_x + shift >= around_.min_x && pixels.max_x + shift <= around_.max_x &&
         pixels.min_y >= around_.min_y && pixels.max_y <= around_.max_y;
}

template <typename Visit>
void GridStatistics::ForMembersAt(const Box& pixels, const Visit& visit) const {
  const std::vector<GridMember>& members = grid_.members();
  if (!statistics_.empty() && (members.size() == 1 || IsAround(pixels))) {
    members_visited_ += near_.size();
    for (std::size_t k = 0; k < near_.size(); ++k) visit(members[near_[k]], statistics_[k].get());
    return;
  }
  for (const std::size_t i : grid_.MembersAt(pixels)) {
    ++members_visited_;
    visit(members[i], nullptr);
  }
}

BlockRange GridStatistics::Ranges(double west, double north, double east, double south) const {
  BlockRange range;
  ForMembersAt({west, north, east, south}, [&](const GridMember& member, const RasterStatistics* statistics) {
    const auto x = static_cast<double>(member.column), y = static_cast<double>(member.row);
    range.Add(statistics != nullptr ? statistics->ranges.Query(west - x, north - y, east - x, south - y)
                                    : member.raster->RangeIn(west - x, north - y, east - x, south - y));
  });
  return range;
}

float GridStatistics::ErrorOfAverages(double west, double north, double east, double south) const {
  const int factor = reading_.factor;
  if (factor == 1) return 0;  // averages of one sample
  const auto error_of = [&](const GridMember& member, const RasterStatistics* statistics, double shift) {
    const auto x = static_cast<double>(member.column) - shift, y = static_cast<double>(member.row);
    const StatisticsPtr read = statistics == nullptr ? member.raster->statistics() : nullptr;
    return (statistics != nullptr ? *statistics : *read)
        .errors.Largest(factor, west - x, north - y, east - x, south - y);
  };
  if (grid_.members().size() == 1) return error_of(grid_.members().front(), statistics_.front().get(), 0);
  constexpr float kNotTold = std::numeric_limits<float>::infinity();
  if (grid_.alignment() < factor) return kNotTold;
  int met = 0;
  float error = 0;
  // `shift`: columns by which the member lies west of its place.
  const auto meet = [&](const GridMember& member, const RasterStatistics* statistics, double shift) {
    const PixelRange pixels = member.pixels();
    if (east < static_cast<double>(pixels.start_x) - shift || west > static_cast<double>(pixels.end_x + 1) - shift ||
        south < static_cast<double>(pixels.start_y) || north > static_cast<double>(pixels.end_y + 1)) {
      return;
    }
    const RasterLayout& layout = member.raster->layout();
    const auto whole = [factor](int samples) { return static_cast<double>(samples / factor * factor); };
    const auto x = static_cast<double>(member.column) - shift, y = static_cast<double>(member.row);
    const bool is_inside =
        west >= x && north >= y && east <= x + whole(layout.columns) && south <= y + whole(layout.height);
    error = ++met == 1 && is_inside ? error_of(member, statistics, shift) : kNotTold;
  };
  ForMembersAt({west, north, east, south}, [&](const GridMember& member, const RasterStatistics* statistics) {
    meet(member, statistics, 0);
    // Columns beyond the last one of a grid around the Earth are its first ones.
    if (grid_.wraps() && member.pixels().end_x >= grid_.columns()) meet(member, statistics, grid_.columns());
  });
  return error;
}

float GridStatistics::AveragingError(double west, double north, double east, double south) const {
  const double factor = reading_.factor, turn = grid_.columns();
  west *= factor, north *= factor, east = (east + 1) * factor, south = (south + 1) * factor;
  const auto error = [&](double shift) { return ErrorOfAverages(west + shift, north, east + shift, south); };
  float largest = error(0);
  if (grid_.wraps() && west < 0) largest = std::max(largest, error(turn));
  if (grid_.wraps() && east > turn) largest = std::max(largest, error(-turn));
  return largest;
}

}  // namespace terrace::dem
