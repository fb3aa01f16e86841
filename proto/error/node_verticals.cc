#include "proto/error/node_verticals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "proto/error/row_error.h"
#include "proto/lattice_angles.h"

namespace terrace::proto {
namespace {

using geo::Vec3;

}  // namespace

NodeVerticals::NodeVerticals(const TileSamples& samples)
    : cells_(samples.cells()),
      step_(geo::ToRadians(samples.lattice.StepDegrees())),
      south_(geo::ToRadians(samples.Latitude(0))) {
  LatticeAngles angles(samples);
  columns_ = std::move(angles.columns);
  rows_.reserve(angles.rows.size());
  for (const geo::SinCos& row : angles.rows) {
    const Vec3 surface = geo::ToEcef({0, 1}, row, 0);
    rows_.push_back({row.sin, row.cos, surface.x, surface.z});
  }
  const HeightExtent extent = ExtentOf(samples.heights);
  lowest_ = extent.lowest;
  highest_ = extent.highest;
  relief_per_radius_ = (highest_ - lowest_ + 1) / kMinRadius;  // vertices are rounded
  narrowest_ = std::min(rows_.front().cos, rows_.back().cos);
  per_narrowest_ = 1 / std::max(narrowest_, 1e-12);
  per_step_ = 1 / step_;
}

NodeVerticals::Plane::Plane(const std::array<Vec3, 3>& corners) {
  constexpr double kNarrowest_m = 1e-5, kSteepest = 1e5;
  const Vec3 a = corners[1] - corners[0], b = corners[2] - corners[0], c = corners[2] - corners[1];
  normal = geo::Cross(a, b);
  offset = geo::Dot(normal, corners[0]);
  const double longest = std::max({geo::Dot(a, a), geo::Dot(b, b), geo::Dot(c, c)});
  min_up = geo::Length(normal) / kSteepest;
  is_line = geo::Dot(normal, normal) <= kNarrowest_m * kNarrowest_m * longest;
}

double NodeVerticals::LargestOfRow(const Plane& plane, int j, std::int64_t first, std::int64_t last,
                                   const float* samples) const {
  const Parallel& row = rows_[static_cast<std::size_t>(j)];
  const PlumbRow plumb{
      plane.normal.x, plane.normal.y, row.cos, row.sin * plane.normal.z, plane.offset - row.z * plane.normal.z,
      row.radius};
  double min_up = 0;
  const double largest = LargestOfPlumbRow(plumb, columns_.data() + first, samples + first,
                                           static_cast<std::size_t>(last + 1 - first), min_up);
  // Whether the plane is too steep for a height at some node.
  return min_up <= plane.min_up ? std::numeric_limits<double>::infinity() : largest;
}

bool NodeVerticals::Meets(const std::array<Vec3, 3>& corners, int i, int j) const {
  constexpr double kBeside_m = 1e-6;  // positions are rounded to a nanometre, directions to 6e-14
  const geo::SinCos& column = columns_[static_cast<std::size_t>(i)];
  const Parallel& row = rows_[static_cast<std::size_t>(j)];
  const Vec3 up{row.cos * column.cos, row.cos * column.sin, row.sin};
  const Vec3 foot{row.radius * column.cos, row.radius * column.sin, row.z};
  std::array<Vec3, 3> from_foot;
  for (std::size_t k = 0; k < 3; ++k) from_foot[k] = corners[k] - foot;
  // Seen along the plumb line the triangle may be flipped, so both orientations are accepted.
  bool left_of_all = true, right_of_all = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 &a = from_foot[k], &b = from_foot[(k + 1) % 3];
    const double side = geo::Dot(up, geo::Cross(a, b)), beside = kBeside_m * geo::Length(b - a);
    left_of_all &= side >= -beside;
    right_of_all &= side <= beside;
  }
  return left_of_all || right_of_all;
}

NodeVerticals::Position NodeVerticals::PositionOf(const Vec3& point, int i, int j) const {
  const geo::SinCos& column = columns_[static_cast<std::size_t>(i)];
  const Parallel& row = rows_[static_cast<std::size_t>(j)];
  const Vec3 up{row.cos * column.cos, row.cos * column.sin, row.sin};
  const Vec3 from_foot = point - Vec3{row.radius * column.cos, row.radius * column.sin, row.z};
  const double height = geo::Dot(from_foot, up);
  return {height, geo::Length(from_foot - up * height)};
}

// The region north of a northern parallel is a cone and convex, so no point of the triangle lies south of its
// southernmost corner. Points may lie north of the northernmost corner, because a chord between meridians is nearer to
// the axis, at most by the cosine of half the angle between them.
std::array<int, 2> NodeVerticals::RowsReached(double width, double low_row, double high_row) const {
  const double half = std::min(width * step_ / 2, std::numbers::pi / 2);
  const double nearer = std::cos(half) > 1e-3 ? 1 / std::cos(half) - 1 : 1e3;
  const auto beyond = [&](double row) {
    const double latitude = south_ + row * step_;
    return 1.02 * std::abs(std::sin(latitude) * std::cos(latitude)) * nearer / step_ + 1e-9;
  };
  const bool reaches_north = south_ + high_row * step_ > 0, reaches_south = south_ + low_row * step_ < 0;
  const double low = low_row - (reaches_south ? beyond(low_row) : 1e-9);
  const double high = high_row + (reaches_north ? beyond(high_row) : 1e-9);
  return {static_cast<int>(std::ceil(std::max(low, 0.0))),
          static_cast<int>(std::floor(std::min(high, static_cast<double>(cells_))))};
}

VerticalsInTriangle::VerticalsInTriangle(const std::array<NodePoint, 3>& corners, std::int64_t unit, double beside_m,
                                         const NodeVerticals& nodes)
    : unit_(unit) {
  const NodeVerticals::Shift shift = nodes.BoundsOf(corners, unit, beside_m).shift;
  const NodeVerticals::Extent extent(corners, unit);
  const double west =
      static_cast<double>(std::min({corners[0].x, corners[1].x, corners[2].x})) / static_cast<double>(unit);
  const double cells = nodes.cells();
  is_bounded_ = std::isfinite(shift.x);
  const double right = is_bounded_ ? shift.x : 1e-9;
  first_column_ = static_cast<int>(std::ceil(std::max(west - right, 0.0)));
  last_column_ = static_cast<int>(std::min(west + extent.columns + right, cells));
  if (is_bounded_) {
    first_row_ = static_cast<int>(std::ceil(std::max(extent.low - shift.y, 0.0)));
    last_row_ = static_cast<int>(std::min(extent.high + shift.y, cells));
  } else {
    const std::array<int, 2> rows = nodes.RowsReached(extent.columns, extent.low, extent.high);
    first_row_ = rows[0];
    last_row_ = rows[1];
  }
  // A triangle without area in longitude and latitude may have an area on the ground.
  is_bounded_ = is_bounded_ && TwiceArea(corners) > 0;
  for (std::size_t k = 0; k < 3; ++k) {
    edges_[k] = EdgeRows(corners[k], corners[(k + 1) % 3], unit);
    if (is_bounded_) {
      moves_[k] = edges_[k].Move(shift.x * static_cast<double>(unit), shift.y * static_cast<double>(unit));
    }
  }
}

VerticalsInTriangle::Columns VerticalsInTriangle::ColumnsOf(int row) const {
  Columns columns{first_column_, last_column_, first_column_, last_column_};
  if (!is_bounded_) {
    columns.inner_last = columns.inner_first - 1;
    return columns;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    edges_[k].ClipMoved(row * unit_, moves_[k], columns.first, columns.last);
    edges_[k].ClipMoved(row * unit_, -moves_[k], columns.inner_first, columns.inner_last);
  }
  return columns;
}

}  // namespace terrace::proto
