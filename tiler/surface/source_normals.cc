#include "tiler/surface/source_normals.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/geo/ellipsoid.h"

namespace terrace::tiler {
namespace {

// The slope at a point, from the heights `reach_m` before and after it.
double Slope(double before, double here, double after, double reach_m) {
  if (!std::isnan(before) && !std::isnan(after)) return (after - before) / (2 * reach_m);
  return (std::isnan(after) ? here - before : after - here) / reach_m;
}

}  // namespace

Result<std::vector<std::array<float, 3>>> SourceNormals(const dem::ElevationModel& model,
                                                        std::span<const dem::GeoPosition> points,
                                                        const std::stop_token& stop) {
  double reach_m = std::numeric_limits<double>::infinity();
  for (const dem::RasterInfo& raster : model.info().sources) reach_m = std::min(reach_m, raster.spacing_m / 2);
  constexpr std::size_t kSides = 4;  // west, east, south, north
  std::vector<dem::GeoPosition> around;
  around.reserve(points.size() * kSides);
  for (const auto& [longitude, latitude] : points) {
    // Near a pole half a sample may be more than a turn.
    const double east = std::min(90.0, reach_m / std::max(1.0, geo::MetresPerDegreeEast(latitude)));
    const double north = reach_m / geo::MetresPerDegreeNorth(latitude);
    const auto turned = [](double degrees) { return std::remainder(degrees, 360); };
    around.push_back({turned(longitude - east), latitude});
    around.push_back({turned(longitude + east), latitude});
    around.push_back({longitude, std::max(latitude - north, -90.0)});
    around.push_back({longitude, std::min(latitude + north, 90.0)});
  }
  const Result<std::vector<float>> sides = model.ReadPoints(around, dem::HeightDatum::kEllipsoid, stop);
  if (!sides) return tl::unexpected(sides.error());
  const Result<std::vector<float>> here = model.ReadPoints(points, dem::HeightDatum::kEllipsoid, stop);
  if (!here) return tl::unexpected(here.error());
  std::vector<std::array<float, 3>> normals;
  normals.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* const side = sides->data() + i * kSides;
    const double own = (*here)[i];
    const double east = Slope(side[0], own, side[1], reach_m) + 0 * own;
    const double north = Slope(side[2], own, side[3], reach_m) + 0 * own;
    const double length = std::sqrt(east * east + north * north + 1);
    normals.push_back(
        {static_cast<float>(-east / length), static_cast<float>(-north / length), static_cast<float>(1 / length)});
  }
  return normals;
}

}  // namespace terrace::tiler
