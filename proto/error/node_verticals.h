// Where the plumb line of a lattice node meets a flat triangle: the height that a client draws at that longitude and
// latitude. The plumb line of a position is the ellipsoid's normal there.
//
// The point of a flat triangle with barycentric coordinates w is close to the position that w gives in longitude and
// latitude, but not equal to it: in a triangle of one degree at 60 degrees north the offset is up to a hundred metres,
// near a pole kilometres.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/error/edge_rows.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

class NodeVerticals {
 public:
  explicit NodeVerticals(const TileSamples& samples);

  // The plane through three points in ECEF.
  struct Plane {
    explicit Plane(const std::array<geo::Vec3, 3>& corners);
    geo::Vec3 normal;   // of any length
    double offset = 0;  // dot(normal, point) of its points
    double min_up = 0;  // the smallest dot(normal, plumb line) with a defined height; steeper planes have none
    // The corners are so close to one line that rounding determines the plane. The triangle is ignored, because its
    // neighbours' edges cover it.
    bool is_line = false;
  };

  // Metres above the ellipsoid at which the node's plumb line passes through the plane; NaN where it lies in the plane.
  double HeightOn(const Plane& plane, int i, int j) const {
    const geo::SinCos& column = columns_[static_cast<std::size_t>(i)];
    const Parallel& row = rows_[static_cast<std::size_t>(j)];
    const double across = column.cos * plane.normal.x + column.sin * plane.normal.y;
    const double up = row.cos * across + row.sin * plane.normal.z;
    if (std::abs(up) <= plane.min_up) return std::numeric_limits<double>::quiet_NaN();
    return (plane.offset - row.z * plane.normal.z - row.radius * across) / up;
  }

  // At least the largest difference between HeightOn and the samples of nodes `first` to `last` of a row. `samples`:
  // from node 0 on. A node whose height is not defined has the largest difference possible.
  double LargestOfRow(const Plane& plane, int j, std::int64_t first, std::int64_t last, const float* samples) const;

  // Whether the node's plumb line passes through the triangle, or at most a micrometre outside of it.
  bool Meets(const std::array<geo::Vec3, 3>& corners, int i, int j) const;

  // The position of a point near the node's plumb line: metres above the ellipsoid, and metres from the line.
  struct Position {
    double height_m = 0, beside_m = 0;
  };
  Position PositionOf(const geo::Vec3& point, int i, int j) const;

  // A bound, in lattice steps, on the offset of a triangle's point from the position that its barycentric coordinates
  // give. Infinite if no bound is known: around a pole, and over more than half a radian.
  struct Shift {
    double x = 0, y = 0;
  };
  // Bounds for one triangle. The longitude of a point is the mean of the corners' longitudes, weighted with their
  // distances from the axis; the error of this is of third order in the difference of their longitudes. The offset of
  // its latitude has three terms: the point is nearer to the axis than the corners, at most by
  // sin(latitude) cos(latitude) d^2 / 8 for a difference d in longitude; the covariance of latitude and height; that of
  // latitude and radius of curvature. All bounds are a few times too large. That costs time, but the result is the
  // same: nodes within the shift of an edge are tested exactly (Meets).
  struct Bounds {
    Shift shift;
    // An upper bound, in metres, of how far the triangle lies below its corners' linear interpolation: half the square
    // of the radius of a circle around it, over the radius of curvature. The radius of the smallest such circle is at
    // most 1/sqrt(3) of the longest edge.
    double sagitta_m = 0;
  };
  // `unit`: distance between nodes, in the unit of the corners' coordinates. `beside_m`: bound on the distance of the
  // corners from their plumb lines.
  Bounds BoundsOf(const std::array<NodePoint, 3>& corners, std::int64_t unit, double beside_m) const {
    const Extent extent(corners, unit);
    const double width = extent.columns * step_, height = extent.rows * step_;
    const double width2 = width * width, height2 = height * height;
    const double sagitta = 1.1 * geo::kSemiMajorAxis / 6 * (width2 + height2);
    if (narrowest_ < 1e-3 || width > 0.5 || height > 0.5) return {kUnknownShift, sagitta};
    const double x = width * (height * per_narrowest_ + 2 * relief_per_radius_ + width2 / 8) +
                     beside_m / kMinRadius * per_narrowest_;
    const double y = width2 / 8 + height * (relief_per_radius_ + 0.02 * height + height2) + beside_m / kMinRadius;
    return {{x * per_step_ + 1e-9, y * per_step_ + 1e-9}, sagitta};
  }

  // The first and last row that points of a triangle can reach, also if BoundsOf is infinite. Their columns are those
  // of the corners, because a wedge between two meridians is convex. `width`: of the triangle from west to east, in
  // columns.
  std::array<int, 2> RowsReached(double width, double low_row, double high_row) const;

  int cells() const { return cells_; }
  // Of all samples of the lattice and its halo, metres.
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }

 private:
  struct Parallel {
    double sin = 0, cos = 0;   // of the latitude
    double radius = 0, z = 0;  // of the ellipsoid's surface, metres: from the axis and along it
  };

  // Lattice steps.
  struct Extent {
    Extent(const std::array<NodePoint, 3>& p, std::int64_t unit) {
      const double inverse = 1 / static_cast<double>(unit);
      low = static_cast<double>(std::min({p[0].y, p[1].y, p[2].y})) * inverse;
      high = static_cast<double>(std::max({p[0].y, p[1].y, p[2].y})) * inverse;
      rows = high - low;
      columns = static_cast<double>(std::max({p[0].x, p[1].x, p[2].x}) - std::min({p[0].x, p[1].x, p[2].x})) * inverse;
    }
    double columns = 0, rows = 0, low = 0, high = 0;
  };
  friend class VerticalsInTriangle;

  // 100 km below the ellipsoid.
  static constexpr double kMinRadius = geo::kSmallestRadius - 1e5;
  static constexpr Shift kUnknownShift = {std::numeric_limits<double>::infinity(),
                                          std::numeric_limits<double>::infinity()};

  int cells_ = 0;
  double step_ = 0;  // radians between two nodes
  double per_step_ = 0;
  double narrowest_ = 0, per_narrowest_ = 0;  // the smallest cosine of a row's latitude
  double lowest_ = 0, highest_ = 0;
  // At least the height of the highest vertex above the lowest one, over the radius of curvature.
  double relief_per_radius_ = 0;
  double south_ = 0;  // radians: the latitude of row 0
  std::vector<geo::SinCos> columns_;
  std::vector<Parallel> rows_;
};

// The set of nodes whose plumb lines may pass through a triangle.
class VerticalsInTriangle {
 public:
  // `unit`: distance between nodes, in the unit of the corners' coordinates.
  VerticalsInTriangle(const std::array<NodePoint, 3>& corners, std::int64_t unit, double beside_m,
                      const NodeVerticals& nodes);

  int first_row() const { return first_row_; }
  int last_row() const { return last_row_; }

  // The columns of a row whose plumb lines may meet the triangle, and among them those that certainly do (inner_*).
  // Empty if the last is before the first.
  struct Columns {
    std::int64_t first = 0, last = -1, inner_first = 0, inner_last = -1;
  };
  Columns ColumnsOf(int row) const;

 private:
  std::array<EdgeRows, 3> edges_;
  std::array<double, 3> moves_{};  // displacement of each edge by the shift
  std::int64_t unit_ = 1;
  bool is_bounded_ = true;  // the shift
  int first_row_ = 0, last_row_ = -1, first_column_ = 0, last_column_ = -1;
};

}  // namespace terrace::proto
