#include "server/handlers/heights_query.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "engine/dem/geodesic_path.h"
#include "engine/geo/tile_key.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

std::optional<double> Number(std::string_view text) { return FiniteNumber(Trim(text, " ")); }

// Items are named by their number: their text is the client's, and nothing of it comes back.
Result<dem::GeoPosition> ParseLocation(std::string_view item, const char* name, std::size_t number) {
  const std::size_t comma = item.find(',');
  if (comma == std::string_view::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: item {} is not \"latitude,longitude\"", name, number);
  }
  const std::optional<double> latitude = Number(item.substr(0, comma)), longitude = Number(item.substr(comma + 1));
  if (!latitude || std::abs(*latitude) > 90) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: item {}: the latitude must be a number from -90 to 90", name,
                     number);
  }
  if (!longitude || std::abs(*longitude) > 180) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: item {}: the longitude must be a number from -180 to 180", name,
                     number);
  }
  return dem::GeoPosition{*longitude, *latitude};
}

tl::unexpected<Error> TooMany(const char* what, std::size_t max_locations) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: more than {} points, which is the most this server answers at once", what, max_locations);
}

Result<std::vector<dem::GeoPosition>> ParseLocations(std::string_view text, const char* name,
                                                     std::size_t max_locations) {
  if (Trim(text, " ").empty()) return MakeError(ErrorCode::kInvalidArgument, "{} is empty", name);
  const auto count = static_cast<std::size_t>(std::count(text.begin(), text.end(), '|')) + 1;
  if (count > max_locations) return TooMany(name, max_locations);
  std::vector<dem::GeoPosition> points;
  points.reserve(count);
  for (std::size_t number = 1; number <= count; ++number) {
    const std::string_view item = text.substr(0, text.find('|'));
    Result<dem::GeoPosition> point = ParseLocation(item, name, number);
    if (!point) return tl::unexpected(std::move(point).error());
    points.push_back(*point);
    text.remove_prefix(std::min(text.size(), item.size() + 1));
  }
  return points;
}

// Each parameter at most once.
struct Wishes {
  std::optional<std::string> locations, path, step, samples, datum, certify;

  Result<void> Set(const std::string& name, const std::string& value) {
    std::optional<std::string>* const known[] = {&locations, &path, &step, &samples, &datum, &certify};
    constexpr const char* kNames[] = {"locations", "path", "step", "samples", "datum", "certify"};
    for (std::size_t i = 0; i < std::size(kNames); ++i) {
      if (name != kNames[i]) continue;
      if (*known[i]) return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", kNames[i]);
      *known[i] = value;
      return {};
    }
    return MakeError(ErrorCode::kInvalidArgument,
                     "unknown parameter; known are locations, path, step, samples, datum, certify");
  }
};

Result<std::vector<dem::PathPoint>> Along(const dem::GeodesicPath& path, const Wishes& wishes,
                                          std::size_t max_locations) {
  if (wishes.step) {
    const std::optional<double> step_m = Number(*wishes.step);
    if (!step_m || *step_m <= 0) return MakeError(ErrorCode::kInvalidArgument, "step must be a finite number above 0");
    if (path.StepCount(*step_m) > static_cast<double>(max_locations)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "path: {:.0f} m in steps of {} m are more than {} points, which is the most this server answers "
                       "at once",
                       path.length_m(), *step_m, max_locations);
    }
    return path.Walk(*step_m);
  }
  std::size_t samples = 0;
  const std::string_view text = *wishes.samples;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), samples);
  const bool is_number = end == text.data() + text.size() && error != std::errc::invalid_argument;
  if (!is_number || (error == std::errc() && samples < 2)) {
    return MakeError(ErrorCode::kInvalidArgument, "samples must be a whole number from 2");
  }
  if (error == std::errc::result_out_of_range || samples > max_locations) return TooMany("samples", max_locations);
  return path.Divide(samples);
}

Result<HeightsQuery> ParsePath(const Wishes& wishes, std::size_t max_locations) {
  if (wishes.step.has_value() == wishes.samples.has_value()) {
    return MakeError(ErrorCode::kInvalidArgument, "path needs either step (metres) or samples (how many points)");
  }
  Result<std::vector<dem::GeoPosition>> corners = ParseLocations(*wishes.path, "path", max_locations);
  if (!corners) return tl::unexpected(std::move(corners).error());
  if (corners->size() < 2) return MakeError(ErrorCode::kInvalidArgument, "path needs at least two points");
  const auto points = Along(dem::GeodesicPath(*std::move(corners)), wishes, max_locations);
  if (!points) return tl::unexpected(points.error());
  HeightsQuery query;
  for (const dem::PathPoint& point : *points) {
    query.points.push_back(point.position);
    query.distances_m.push_back(point.distance_m);
  }
  return query;
}

bool HasMediaType(std::string_view content_type, std::string_view type) {
  return EqualsIgnoringCase(Trim(content_type.substr(0, content_type.find(';'))), type);
}

bool IsForm(std::string_view content_type) { return HasMediaType(content_type, "application/x-www-form-urlencoded"); }
bool IsJson(std::string_view content_type) { return HasMediaType(content_type, "application/json"); }

// Two readers of a key that is given twice may take one or the other, and the library keeps the last.
Result<QueryParameters> ParseJsonBody(std::string_view body) {
  std::set<std::string> keys;
  bool repeated = false;
  const auto watch = [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
    if (event == nlohmann::json::parse_event_t::key && depth == 1) {
      repeated = !keys.insert(parsed.get<std::string>()).second || repeated;
    }
    return true;
  };
  const auto json = nlohmann::json::parse(body, watch, /*allow_exceptions=*/false);
  if (!json.is_object()) return MakeError(ErrorCode::kInvalidArgument, "the body is not a JSON object");
  if (repeated) return MakeError(ErrorCode::kInvalidArgument, "the body has a key more than once");
  QueryParameters parameters;
  for (const auto& [name, value] : json.items()) {
    if (!value.is_string() && !value.is_number()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "the body's values must be texts or numbers, such as {{\"locations\": \"46.5,8.1|46.6,8.2\"}}");
    }
    parameters.emplace_back(name, value.is_string() ? value.get<std::string>() : value.dump());
  }
  return parameters;
}

}  // namespace

namespace {

Result<HeightsQuery> ParsePoints(const Wishes& wishes, std::size_t max_locations) {
  if (wishes.locations.has_value() == wishes.path.has_value()) {
    return MakeError(ErrorCode::kInvalidArgument, "either locations or path is needed: latitude,longitude|...");
  }
  if (wishes.path) return ParsePath(wishes, max_locations);
  if (wishes.step || wishes.samples) return MakeError(ErrorCode::kInvalidArgument, "step and samples need path");
  Result<std::vector<dem::GeoPosition>> points = ParseLocations(*wishes.locations, "locations", max_locations);
  if (!points) return tl::unexpected(std::move(points).error());
  HeightsQuery query;
  query.points = *std::move(points);
  return query;
}

Result<int> ParseCertifyLevel(std::string_view text) {
  if (text == "deepest") return geo::kMaxLevel;
  int level = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), level);
  if (text.empty() || end != text.data() + text.size() || error != std::errc() || level < 0 || level > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument, "certify must be deepest, or a level from 0 to {}", geo::kMaxLevel);
  }
  return level;
}

}  // namespace

Result<HeightsQuery> ParseHeightsQuery(const QueryParameters& parameters, std::size_t max_locations) {
  Wishes wishes;
  for (const auto& [name, value] : parameters) {
    if (name == "v") continue;
    if (const Result<void> set = wishes.Set(name, value); !set) return tl::unexpected(set.error());
  }
  Result<HeightsQuery> query = ParsePoints(wishes, max_locations);
  if (query && wishes.certify) {
    const Result<int> level = ParseCertifyLevel(*wishes.certify);
    if (!level) return tl::unexpected(level.error());
    query->certify_level = *level;
  }
  if (!query || !wishes.datum || *wishes.datum == "ellipsoid") return query;
  if (*wishes.datum != "orthometric") {
    return MakeError(ErrorCode::kInvalidArgument, "datum must be ellipsoid or orthometric");
  }
  query->datum = dem::HeightDatum::kOrthometric;
  return query;
}

bool IsHeightsBody(std::string_view content_type) { return IsForm(content_type) || IsJson(content_type); }

Result<QueryParameters> ParseHeightsBody(std::string_view content_type, std::string_view body) {
  if (!IsForm(content_type)) return ParseJsonBody(body);
  std::string form(body);
  std::replace(form.begin(), form.end(), '+', ' ');
  return ParseQuery(form);
}

}  // namespace terrace::server
