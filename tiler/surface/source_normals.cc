#include "tiler/surface/source_normals.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "engine/geo/ellipsoid.h"

namespace terrace::tiler {
namespace {

// The slope at a point, from the heights `reach_m` before and after it.
double Slope(double before, double here, double after, double reach_m) {
  if (!std::isnan(before) && !std::isnan(after)) return (after - before) / (2 * reach_m);
  return (std::isnan(after) ? here - before : after - here) / reach_m;
}

// The positions `reach_m` west, east, south and north of a point.
std::array<dem::GeoPosition, 4> PositionsAround(const dem::GeoPosition& point, double reach_m) {
  const double longitude = point.longitude, latitude = point.latitude;
  const double north = reach_m / geo::MetresPerDegreeNorth(latitude);
  const double east = reach_m / geo::MetresPerDegreeEast(latitude);
  constexpr double kMaxEast = 1;  // degrees
  if (east < kMaxEast) {
    const auto turned = [](double degrees) { return std::remainder(degrees, 360); };
    return {{{turned(longitude - east), latitude},
             {turned(longitude + east), latitude},
             {longitude, latitude - north},
             {longitude, latitude + north}}};
  }
  // Parallels are too curved here. The surroundings of the pole are a plane, in degrees of latitude from it. Rounded,
  // because results of the C library differ between processors.
  const geo::SinCos meridian = geo::RoundedSinCos(longitude);
  const double pole = latitude < 0 ? -1 : 1;
  const auto rounded = [](double degrees) { return std::round(std::ldexp(degrees, 30)) / (1 << 30); };
  const auto place = [&](double to_east, double to_north) {
    const double from_pole = 90 - std::abs(latitude) - pole * to_north;
    const double x = from_pole * meridian.cos - to_east * meridian.sin;
    const double y = from_pole * meridian.sin + to_east * meridian.cos;
    return dem::GeoPosition{rounded(geo::ToDegrees(std::atan2(y, x))), rounded(pole * (90 - std::hypot(x, y)))};
  };
  return {{place(-north, 0), place(north, 0), place(0, -north), place(0, north)}};
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
  for (const dem::GeoPosition& point : points)
    std::ranges::copy(PositionsAround(point, reach_m), std::back_inserter(around));
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
