#include "engine/crs/geodesic_path.h"

#include <geodesic.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/geo/ellipsoid.h"

namespace terrace::dem {
namespace {

// A last step shorter than this is a rounding error of the division.
constexpr double kNoStepM = 1e-6;

geod_geodesic Ellipsoid() {
  geod_geodesic ellipsoid;
  geod_init(&ellipsoid, geo::kSemiMajorAxis, geo::kFlattening);
  return ellipsoid;
}

// Geodesics solved between two checks of the stop token: about a millisecond.
constexpr std::size_t kStopStride = 512;

double RoundTo(double value, double parts) { return std::round(value * parts) / parts; }

}  // namespace

GeodesicPath::GeodesicPath(std::vector<GeoPosition> corners, std::stop_token stop)
    : corners_(std::move(corners)), stop_(std::move(stop)), ends_m_{0} {
  TERRACE_CHECK(corners_.size() >= 2);
  const geod_geodesic ellipsoid = Ellipsoid();
  for (std::size_t i = 1; i < corners_.size(); ++i) {
    if (i % kStopStride == 0 && stop_.stop_requested()) return;
    const GeoPosition &from = corners_[i - 1], &to = corners_[i];
    double length = 0;
    geod_inverse(&ellipsoid, from.latitude, from.longitude, to.latitude, to.longitude, &length, nullptr, nullptr);
    ends_m_.push_back(ends_m_.back() + length);
  }
}

std::vector<PathPoint> GeodesicPath::At(std::span<const double> distances) const {
  const geod_geodesic ellipsoid = Ellipsoid();
  std::vector<PathPoint> points;
  points.reserve(distances.size());
  std::size_t leg = 0;  // from corner `leg` to the next
  geod_geodesicline line;
  bool has_line = false;
  for (const double distance : distances) {
    if (points.size() % kStopStride == 0 && stop_.stop_requested()) return {};
    for (; leg + 2 < corners_.size() && distance > ends_m_[leg + 1]; ++leg) has_line = false;
    if (!has_line) {
      const GeoPosition &from = corners_[leg], &to = corners_[leg + 1];
      geod_inverseline(&line, &ellipsoid, from.latitude, from.longitude, to.latitude, to.longitude,
                       GEOD_LATITUDE | GEOD_LONGITUDE | GEOD_DISTANCE_IN);
      has_line = true;
    }
    PathPoint point;
    geod_position(&line, distance - ends_m_[leg], &point.position.latitude, &point.position.longitude, nullptr);
    constexpr double kPartsOfDegree = 1e9, kPartsOfMetre = 1e3;
    point.position = {RoundTo(point.position.longitude, kPartsOfDegree),
                      RoundTo(point.position.latitude, kPartsOfDegree)};
    point.distance_m = RoundTo(distance, kPartsOfMetre);
    points.push_back(point);
  }
  points.front().position = corners_.front();
  points.back().position = corners_.back();
  return points;
}

std::vector<PathPoint> GeodesicPath::Divide(std::size_t count) const {
  TERRACE_CHECK(count >= 2);
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; ++i) {
    distances.push_back(length_m() * static_cast<double>(i) / static_cast<double>(count - 1));
  }
  return At(distances);
}

double GeodesicPath::StepCount(double step_m) const {
  return std::max(1.0, std::ceil((length_m() - kNoStepM) / step_m)) + 1;
}

std::vector<PathPoint> GeodesicPath::Walk(double step_m) const {
  TERRACE_CHECK(step_m > 0);
  const auto steps = static_cast<std::size_t>(StepCount(step_m)) - 1;
  std::vector<double> distances;
  for (std::size_t i = 0; i < steps; ++i) distances.push_back(step_m * static_cast<double>(i));
  distances.push_back(length_m());
  return At(distances);
}

}  // namespace terrace::dem
