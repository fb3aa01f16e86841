#include "fly/scene/flight_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "fly/scene/json_reason.h"

namespace terrace::fly {
namespace {

using Json = nlohmann::json;

constexpr double kMeanRadius = 6371000;
constexpr double kStepDegrees = 0.05;  // between the points of a great circle
constexpr double kSamePlace = 1e-6;    // metres; rounding moves equal points apart by nanometres
constexpr std::size_t kMaxPoints = 1'000'000;
constexpr const char* kPointForms = "lon,lat,height[,heading,pitch] or seconds,lon,lat,height,heading,pitch";

// The turn from a to b, -180 to 180.
double Turn(double a, double b) { return std::remainder(b - a, 360.0); }

// Where the surface has the normal `n`, of any length.
GeodeticPoint PlaceOf(const geo::Vec3& n, double height_m) {
  return {geo::ToDegrees(std::atan2(n.y, n.x)), geo::ToDegrees(std::atan2(n.z, std::hypot(n.x, n.y))), height_m};
}

double GroundMetres(const GeodeticPoint& a, const GeodeticPoint& b) {
  const geo::Vec3 u = geo::SurfaceNormal(a.longitude, a.latitude), v = geo::SurfaceNormal(b.longitude, b.latitude);
  return kMeanRadius * std::atan2(geo::Length(geo::Cross(u, v)), geo::Dot(u, v));
}

double Metres(const GeodeticPoint& a, const GeodeticPoint& b) {
  return std::hypot(GroundMetres(a, b), b.height_m - a.height_m);
}

double HeadingFromTo(const GeodeticPoint& a, const GeodeticPoint& b) {
  const double turn = geo::ToRadians(b.longitude - a.longitude);
  const double lat_a = geo::ToRadians(a.latitude), lat_b = geo::ToRadians(b.latitude);
  return geo::ToDegrees(
      std::atan2(std::sin(turn) * std::cos(lat_b),
                 std::cos(lat_a) * std::sin(lat_b) - std::sin(lat_a) * std::cos(lat_b) * std::cos(turn)));
}

// Sets times by speed, headings along the path, and the pitch.
void SetTimesAndHeadings(const FlightSpeed& speed, FlightPath& path) {
  std::vector<FlightPath::Point>& points = path.points;
  double heading = 0;  // a vertical part keeps that of the part before
  for (std::size_t i = 0; i < points.size(); ++i) {
    Pose& pose = points[i].pose;
    pose.pitch = speed.pitch;
    if (i + 1 < points.size()) {
      const GeodeticPoint& next = points[i + 1].pose.position;
      if (GroundMetres(pose.position, next) > kSamePlace) heading = HeadingFromTo(pose.position, next);
    } else if (path.is_closed) {
      heading = points[0].pose.heading;
    }
    pose.heading = heading;
    if (i == 0) continue;
    const Pose& before = points[i - 1].pose;
    points[i].seconds = points[i - 1].seconds + Metres(before.position, pose.position) / speed.metres_per_second;
  }
}

// Removes jumps of the longitudes at the antimeridian.
void Unwrap(FlightPath& path) {
  for (std::size_t i = 1; i < path.points.size(); ++i) {
    const double before = path.points[i - 1].pose.position.longitude;
    double& longitude = path.points[i].pose.position.longitude;
    longitude = before + Turn(before, longitude);
  }
}

// Numbers with a comma or blanks between them, or none. Nothing if the line has anything else, or an empty field.
std::optional<std::vector<double>> Numbers(std::string_view line) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  const auto skip_blanks = [&at, end] {
    while (at < end && (*at == ' ' || *at == '\t' || *at == '\r')) ++at;
  };
  skip_blanks();
  if (at == end) return numbers;
  for (;;) {
    double value = 0;
    const char* const begin = at;
    const auto [next, error] = std::from_chars(begin, end, value);
    if (error != std::errc() || !std::isfinite(value)) return std::nullopt;
    numbers.push_back(value);
    at = next;
    skip_blanks();
    if (at == end) return numbers;
    if (*at == ',') {
      ++at;
      skip_blanks();
    } else if (at == next) {
      return std::nullopt;
    }
  }
}

Result<void> AddPoint(const std::vector<double>& n, std::string_view where, FlightPath& path) {
  if (n.size() != 3 && n.size() != 5 && n.size() != 6) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {} numbers; write {}", where, n.size(), kPointForms);
  }
  const std::size_t first = n.size() == 6 ? 1 : 0;
  FlightPath::Point point;
  point.seconds = first == 1 ? n[0] : 0;
  point.pose.position = {n[first], n[first + 1], n[first + 2]};
  if (n.size() > 3) {
    point.pose.heading = n[first + 3];
    point.pose.pitch = n[first + 4];
  }
  if (const Result<void> checked = CheckPosition(point.pose.position); !checked) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {}", where, checked.error().message);
  }
  if (std::abs(point.pose.heading) > 360 || std::abs(point.pose.pitch) > 90) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: heading {} and pitch {} are not within -360 .. 360 and -90 .. 90 degrees", where,
                     point.pose.heading, point.pose.pitch);
  }
  if (first == 1 && !path.points.empty() && point.seconds <= path.points.back().seconds) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the seconds do not ascend", where);
  }
  if (path.points.size() == kMaxPoints) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: more than {} points", where, kMaxPoints);
  }
  path.points.push_back(point);
  return {};
}

// The first LineString of a GeoJSON object or a list of them. Other members, such as properties, are not searched.
const Json* FindLine(const Json& json) {
  if (json.is_array()) {
    for (const Json& part : json) {
      if (const Json* line = FindLine(part)) return line;
    }
  }
  if (!json.is_object()) return nullptr;
  if (const auto type = json.find("type"); type != json.end() && *type == "LineString") return &json;
  for (const char* member : {"features", "geometry", "geometries"}) {
    const auto part = json.find(member);
    if (part == json.end()) continue;
    if (const Json* line = FindLine(*part)) return line;
  }
  return nullptr;
}

// Returns the numbers of each point.
Result<std::size_t> ReadGeoJson(std::string_view text, FlightPath& path) {
  try {
    const Json json = Json::parse(text);
    const Json* line = FindLine(json);
    if (line == nullptr) return MakeError(ErrorCode::kInvalidArgument, "the GeoJSON has no LineString");
    for (const Json& point : line->at("coordinates")) {
      const auto numbers = point.get<std::vector<double>>();
      const std::string where = fmt::format("point {}", path.points.size() + 1);
      if (numbers.size() != 3) {
        return MakeError(ErrorCode::kInvalidArgument, "{}: needs longitude, latitude and height", where);
      }
      if (Result<void> added = AddPoint(numbers, where, path); !added) return tl::unexpected(added.error());
    }
    return 3;
  } catch (const std::exception& error) {
    return MakeError(ErrorCode::kInvalidArgument, "the GeoJSON cannot be read: {}", JsonReason(error));
  }
}

// Returns the numbers of each line.
Result<std::size_t> ReadLines(std::string_view text, FlightPath& path) {
  std::size_t columns = 0;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::optional<std::vector<double>> numbers = Numbers(line.substr(0, line.find('#')));
    const std::string where = fmt::format("line {}", number);
    if (!numbers)
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: has something other than numbers with commas or blanks between them; write {}", where,
                       kPointForms);
    if (numbers->empty()) continue;
    if (columns != 0 && numbers->size() != columns) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: {} numbers, but {} in the lines before", where,
                       numbers->size(), columns);
    }
    columns = numbers->size();
    if (Result<void> added = AddPoint(*numbers, where, path); !added) return tl::unexpected(added.error());
  }
  return columns;
}

}  // namespace

double FlightPath::length_m() const {
  double sum = 0;
  for (std::size_t i = 1; i < points.size(); ++i) sum += Metres(points[i - 1].pose.position, points[i].pose.position);
  return sum;
}

Pose FlightPath::PoseAt(double seconds) const {
  const double whole = duration_s();
  double at = whole <= 0 ? 0 : std::fmod(seconds, is_closed ? whole : 2 * whole);
  if (at > whole) at = 2 * whole - at;
  const auto after = std::lower_bound(points.begin(), points.end(), at,
                                      [](const Point& point, double when) { return point.seconds < when; });
  Pose pose = after == points.end() ? points.back().pose : after->pose;
  if (after != points.begin() && after != points.end()) {
    const Pose &a = (after - 1)->pose, &b = after->pose;
    const double fraction = (at - (after - 1)->seconds) / (after->seconds - (after - 1)->seconds);
    const auto mix = [fraction](double from, double to) { return from + (to - from) * fraction; };
    pose.position = {mix(a.position.longitude, b.position.longitude), mix(a.position.latitude, b.position.latitude),
                     mix(a.position.height_m, b.position.height_m)};
    pose.heading = a.heading + Turn(a.heading, b.heading) * fraction;
    pose.pitch = mix(a.pitch, b.pitch);
  }
  pose.position.longitude = std::remainder(pose.position.longitude, 360.0);
  return pose;
}

Result<void> CheckPosition(const GeodeticPoint& point) {
  if (!(std::abs(point.longitude) <= 360 && std::abs(point.latitude) <= 90)) {
    return MakeError(ErrorCode::kInvalidArgument, "no longitude and latitude in degrees, in this order");
  }
  if (!(point.height_m >= kMinCameraHeight && point.height_m <= kMaxCameraHeight)) {
    return MakeError(ErrorCode::kInvalidArgument, "the height must be a number from {:.0f} to {:.0f} m",
                     kMinCameraHeight, kMaxCameraHeight);
  }
  return {};
}

bool AreOpposite(const GeodeticPoint& from, const GeodeticPoint& to) {
  constexpr double kNearest = 1e-4;  // radians, 640 m
  const geo::Vec3 u = geo::SurfaceNormal(from.longitude, from.latitude);
  const geo::Vec3 v = geo::SurfaceNormal(to.longitude, to.latitude);
  return geo::Length(u + v) < kNearest;
}

FlightPath MakeStraightPath(const GeodeticPoint& from, const GeodeticPoint& to, const FlightSpeed& speed) {
  FlightPath path;
  const geo::Vec3 u = geo::SurfaceNormal(from.longitude, from.latitude);
  const geo::Vec3 v = geo::SurfaceNormal(to.longitude, to.latitude);
  const double angle = std::atan2(geo::Length(geo::Cross(u, v)), geo::Dot(u, v));
  const int steps = std::max(1, static_cast<int>(std::ceil(geo::ToDegrees(angle) / kStepDegrees)));
  for (int i = 0; i <= steps; ++i) {
    const double fraction = static_cast<double>(i) / steps;
    GeodeticPoint point = i == 0 ? from : to;
    if (i > 0 && i < steps) {
      point = PlaceOf(u * std::sin((1 - fraction) * angle) + v * std::sin(fraction * angle), 0);
    }
    point.height_m = from.height_m + (to.height_m - from.height_m) * fraction;
    path.points.push_back({0, {point, 0, 0}});
  }
  Unwrap(path);
  SetTimesAndHeadings(speed, path);
  if (path.duration_s() <= 0) path.points.resize(1);
  return path;
}

FlightPath MakeCircle(const GeodeticPoint& center, double radius_m, const FlightSpeed& speed) {
  FlightPath path;
  path.is_closed = true;
  const double angle = radius_m / kMeanRadius;
  // Vectors have no singularity at the poles.
  const double lat = geo::ToRadians(center.latitude), lon = geo::ToRadians(center.longitude);
  const geo::Vec3 up = geo::SurfaceNormal(center.longitude, center.latitude);
  const geo::Vec3 north{-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat)};
  const geo::Vec3 east{-std::sin(lon), std::cos(lon), 0};
  constexpr int kSteps = 360;
  for (int i = 0; i <= kSteps; ++i) {
    const double bearing = geo::ToRadians(i * 360.0 / kSteps);
    const geo::Vec3 away = north * std::cos(bearing) + east * std::sin(bearing);
    path.points.push_back({0, {PlaceOf(up * std::cos(angle) + away * std::sin(angle), center.height_m), 0, 0}});
  }
  Unwrap(path);
  SetTimesAndHeadings(speed, path);
  return path;
}

Result<FlightPath> ParsePath(std::string_view text, const FlightSpeed& speed) {
  if (constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF"; text.starts_with(kByteOrderMark)) {
    text.remove_prefix(kByteOrderMark.size());
  }
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const bool is_geojson = first != std::string_view::npos && text[first] == '{';
  FlightPath path;
  const Result<std::size_t> columns = is_geojson ? ReadGeoJson(text, path) : ReadLines(text, path);
  if (!columns) return tl::unexpected(columns.error());
  if (path.points.empty()) return MakeError(ErrorCode::kInvalidArgument, "the path has no points");
  Unwrap(path);
  std::vector<FlightPath::Point>& points = path.points;
  if (*columns == 6) {
    const double start = points[0].seconds;
    for (FlightPath::Point& point : points) point.seconds -= start;
    return path;
  }
  // Points at one place take no time, and have no direction.
  points.erase(
      std::unique(points.begin(), points.end(),
                  [](const auto& a, const auto& b) { return Metres(a.pose.position, b.pose.position) <= kSamePlace; }),
      points.end());
  const std::vector<FlightPath::Point> stated = points;
  SetTimesAndHeadings(speed, path);
  if (*columns == 5) {
    for (std::size_t i = 0; i < stated.size(); ++i) points[i].pose = stated[i].pose;
  }
  return path;
}

}  // namespace terrace::fly
