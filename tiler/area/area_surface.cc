#include "tiler/area/area_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "engine/tin/scan/triangle_rows.h"
#include "tiler/mesh/refine_options.h"

namespace terrace::tiler {
namespace {

constexpr std::size_t kStopPeriod = 1024;  // triangles

// Rotates from longitude 0 to the longitude of the equatorial unit vector.
geo::Vec3 Turned(geo::Vec3 at_zero, geo::Vec3 equatorial) {
  return {at_zero.x * equatorial.x, at_zero.x * equatorial.y, at_zero.z};
}

double DistanceToSegment(geo::Vec3 point, geo::Vec3 a, geo::Vec3 b) {
  const geo::Vec3 along = b - a, to_point = point - a;
  const double squared = geo::Dot(along, along);
  const double share = squared > 0 ? std::clamp(geo::Dot(to_point, along) / squared, 0.0, 1.0) : 0;
  return geo::Length(to_point - along * share);
}

// A triangle in space.
class FlatTriangle {
 public:
  FlatTriangle(geo::Vec3 a, geo::Vec3 b, geo::Vec3 c) : a_(a), b_(b), c_(c), plane_(geo::Cross(b - a, c - a)) {}

  // The distance of a point from the plane along `up`. At a pole, a triangle can shrink to a line that no vertical
  // meets; then the distance from the line.
  double Distance(geo::Vec3 point, geo::Vec3 up) const {
    const double off = std::abs(geo::Dot(a_ - point, plane_) / geo::Dot(up, plane_));
    if (std::isfinite(off)) return off;
    return std::min(
        {DistanceToSegment(point, a_, b_), DistanceToSegment(point, b_, c_), DistanceToSegment(point, c_, a_)});
  }

 private:
  const geo::Vec3 a_, b_, c_, plane_;
};

}  // namespace

AreaSurface::AreaSurface(const geo::Lattice& lattice, const dem::NodeWindow& window)
    : lattice_(lattice), window_(window) {
  for (int i = 0; i < window.columns; ++i) column_normals_.push_back(geo::SurfaceNormal(At(i, 0).longitude, 0));
  for (int j = 0; j < window.rows; ++j) {
    const double latitude = At(0, j).latitude;
    row_normals_.push_back(geo::SurfaceNormal(0, latitude));
    row_points_.push_back(geo::ToEcef(0, latitude, 0));
  }
}

dem::GeoPosition AreaSurface::At(int column, int row) const {
  return {-180 + static_cast<double>(window_.column + column) * lattice_.StepDegrees(),
          lattice_.Latitude(window_.row + row)};
}

geo::Vec3 AreaSurface::Up(int column, int row) const {
  return Turned(row_normals_[static_cast<std::size_t>(row)], column_normals_[static_cast<std::size_t>(column)]);
}

geo::Vec3 AreaSurface::Ecef(int column, int row, double height_m) const {
  const geo::Vec3 foot =
      Turned(row_points_[static_cast<std::size_t>(row)], column_normals_[static_cast<std::size_t>(column)]);
  return foot + Up(column, row) * height_m;
}

void AreaSurface::AddCurvature(tin::GreedyOptions& options) const {
  const double step = lattice_.StepDegrees(), radians = geo::ToRadians(step);
  std::vector<double> latitudes;
  for (int j = 0; j < window_.rows; ++j) latitudes.push_back(At(0, j).latitude);
  options.curvature = {SquaredEastSteps(latitudes, step), radians * geo::kLargestRadius * radians * geo::kLargestRadius,
                       geo::kSmallestRadius};
  for (const tin::Side side : {tin::Side::kSouth, tin::Side::kEast, tin::Side::kNorth, tin::Side::kWest}) {
    const bool is_parallel = side == tin::Side::kSouth || side == tin::Side::kNorth;
    const double latitude = At(0, side == tin::Side::kSouth ? 0 : window_.rows - 1).latitude;
    const double cosine = geo::SurfaceNormal(0, latitude).x;
    const double radius = is_parallel ? geo::PrimeVerticalRadius(latitude) * cosine * cosine : geo::kLargestRadius;
    options.borders[static_cast<std::size_t>(side)].sagitta_m = radians * radians * radius / 2;
  }
}

proto::TileError AreaSurface::MeasureError(const tin::HeightField& field, const tin::TinMesh& mesh,
                                           const std::vector<geo::Vec3>& ecef, double bound_m,
                                           std::span<const float> allowed, const std::stop_token& stop) const {
  proto::TileError error;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % kStopPeriod == 0 && stop.stop_requested()) break;
    const auto& triangle = mesh.triangles[t];
    const FlatTriangle flat(ecef[triangle[0]], ecef[triangle[1]], ecef[triangle[2]]);
    const std::array<tin::SamplePosition, 3> corners = {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]],
                                                        mesh.vertices[triangle[2]]};
    std::optional<tin::SamplePosition> worst_sample;
    double worst = allowed.empty() ? bound_m : 1;  // with bounds by sample: as a multiple of the sample's bound
    tin::ForEachRow(corners, [&](int row, int first, int last) {
      for (int column = first; column <= last; ++column) {
        const geo::Vec3 at = Ecef(column, row, field.At(column, row));
        double off = flat.Distance(at, Up(column, row));
        const std::size_t k =
            static_cast<std::size_t>(row) * static_cast<std::size_t>(field.width()) + static_cast<std::size_t>(column);
        const double counted = allowed.empty() ? off : off / static_cast<double>(allowed[k]);
        if (counted > worst) {
          const tin::SamplePosition sample{static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(row)};
          const auto corner = std::find(corners.begin(), corners.end(), sample);
          if (corner == corners.end()) {
            worst = counted;
            worst_sample = sample;
          } else {
            // Beside its rounded position, the plane of a triangle that stands almost upright is anywhere.
            const std::uint32_t vertex = triangle[static_cast<std::size_t>(corner - corners.begin())];
            off = std::min(off, geo::Length(at - ecef[vertex]));
          }
        }
        error.max_m = std::max(error.max_m, off);
      }
    });
    if (worst_sample) error.to_insert.push_back(*worst_sample);
  }
  // A sample on an edge is the worst one of two triangles.
  const auto in_rows = [](tin::SamplePosition p) { return std::pair(p.y, p.x); };
  std::ranges::sort(error.to_insert, {}, in_rows);
  error.to_insert.erase(std::unique(error.to_insert.begin(), error.to_insert.end()), error.to_insert.end());
  return error;
}

geo::Vec3 RoundPosition(geo::Vec3 metres) {
  const auto round = [](double value) { return std::nearbyint(value * 1024) / 1024; };
  return {round(metres.x), round(metres.y), round(metres.z)};
}

}  // namespace terrace::tiler
