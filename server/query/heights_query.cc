#include "server/query/heights_query.h"

#include <charconv>
#include <string>
#include <utility>

#include "engine/core/plain_number.h"
#include "engine/dem/crs/geodesic_path.h"
#include "engine/geo/tile_key.h"
#include "server/http/text.h"
#include "server/query/heights_parameters.h"
#include "server/query/parameters.h"

namespace terrace::server {
namespace {

bool HasMediaType(std::string_view content_type, std::string_view type) {
  return EqualsIgnoringCase(Trim(content_type.substr(0, content_type.find(';'))), type);
}

bool IsForm(std::string_view content_type) { return HasMediaType(content_type, "application/x-www-form-urlencoded"); }
bool IsJson(std::string_view content_type) { return HasMediaType(content_type, "application/json"); }

Result<void> ReadInput(const HeightsInput& input, const std::stop_token& stop, HeightsParameters& parameters) {
  std::size_t at = 0;
  Result<void> read = ReadForm(PartsOf(input.query, stop), PlusSign::kIsPlus, parameters, at);
  if (!read || input.content_type.empty()) return read;
  const TextParts parts = PartsOf(input.body, stop);
  read = IsForm(input.content_type) ? ReadForm(parts, PlusSign::kIsBlank, parameters, at)
                                    : ReadJsonObject(parts, parameters, at);
  if (!read && read.error().code == ErrorCode::kInvalidArgument) {
    return MakeError(ErrorCode::kInvalidArgument, "the body, byte {}: {}", at, read.error().message);
  }
  return read;
}

Result<std::vector<dem::PathPoint>> Along(const dem::GeodesicPath& path, const HeightsParameters& parameters,
                                          std::size_t max_locations) {
  if (const auto& step = parameters.text(HeightsParameters::kStep)) {
    const std::optional<double> step_m = NumberOf(*step);
    if (!step_m || *step_m <= 0) return MakeError(ErrorCode::kInvalidArgument, "step must be a finite number above 0");
    if (path.StepCount(*step_m) > static_cast<double>(max_locations)) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "path: {:.0f} m in steps of {} m have more than {} points, which is max_locations of this server; "
          "ask for a longer step or a shorter path",
          path.length_m(), PlainNumber(*step_m), max_locations);
    }
    return path.Walk(*step_m);
  }
  std::size_t samples = 0;
  const std::string_view text = *parameters.text(HeightsParameters::kSamples);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), samples);
  const bool is_number = end == text.data() + text.size() && error != std::errc::invalid_argument;
  if (!is_number || (error == std::errc() && samples < 2)) {
    return MakeError(ErrorCode::kInvalidArgument, "samples must be a whole number from 2");
  }
  if (error == std::errc::result_out_of_range || samples > max_locations) {
    return TooManyPoints("samples", max_locations);
  }
  return path.Divide(samples);
}

Result<HeightsQuery> ParsePath(HeightsParameters& parameters, std::size_t max_locations, const std::stop_token& stop) {
  if (parameters.text(HeightsParameters::kStep).has_value() ==
      parameters.text(HeightsParameters::kSamples).has_value()) {
    return MakeError(ErrorCode::kInvalidArgument, "path needs either step (metres) or samples (how many points)");
  }
  std::vector<dem::GeoPosition> corners = parameters.TakePoints();
  if (corners.size() < 2) return MakeError(ErrorCode::kInvalidArgument, "path needs at least two points");
  const auto points = Along(dem::GeodesicPath(std::move(corners), stop), parameters, max_locations);
  if (!points) return tl::unexpected(points.error());
  HeightsQuery query;
  query.points.reserve(points->size());
  query.distances_m.reserve(points->size());
  for (const dem::PathPoint& point : *points) {
    query.points.push_back(point.position);
    query.distances_m.push_back(point.distance_m);
  }
  return query;
}

Result<HeightsQuery> ParsePoints(HeightsParameters& parameters, std::size_t max_locations,
                                 const std::stop_token& stop) {
  if (!parameters.has_points()) {
    return MakeError(ErrorCode::kInvalidArgument, "either locations or path is needed: latitude,longitude|...");
  }
  if (parameters.is_path()) return ParsePath(parameters, max_locations, stop);
  if (parameters.text(HeightsParameters::kStep) || parameters.text(HeightsParameters::kSamples)) {
    return MakeError(ErrorCode::kInvalidArgument, "step and samples need path");
  }
  HeightsQuery query;
  query.points = parameters.TakePoints();
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

Result<void> SetDatum(std::string_view text, HeightsQuery& query) {
  if (text == "ellipsoid") return {};
  if (text != "orthometric") {
    return MakeError(ErrorCode::kInvalidArgument, "datum must be ellipsoid or orthometric");
  }
  query.datum = dem::HeightDatum::kOrthometric;
  return {};
}

}  // namespace

bool IsHeightsBody(std::string_view content_type) { return IsForm(content_type) || IsJson(content_type); }

Result<HeightsQuery> ParseHeights(const HeightsInput& input, std::size_t max_locations, const std::stop_token& stop) {
  HeightsParameters parameters(max_locations, input.query.size() + input.body.size());
  if (const Result<void> read = ReadInput(input, stop, parameters); !read) return tl::unexpected(read.error());
  Result<HeightsQuery> query = ParsePoints(parameters, max_locations, stop);
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the request any more");
  if (!query) return query;
  if (const auto& certify = parameters.text(HeightsParameters::kCertify)) {
    const Result<int> level = ParseCertifyLevel(*certify);
    if (!level) return tl::unexpected(level.error());
    query->certify_level = *level;
  }
  if (const auto& datum = parameters.text(HeightsParameters::kDatum)) {
    if (const Result<void> set = SetDatum(*datum, *query); !set) return tl::unexpected(set.error());
  }
  return query;
}

}  // namespace terrace::server
