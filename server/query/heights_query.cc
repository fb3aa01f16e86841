#include "server/query/heights_query.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/core/parse_number.h"
#include "engine/core/plain_number.h"
#include "engine/crs/geodesic_path.h"
#include "engine/geo/tile_key.h"
#include "server/http/text.h"
#include "server/query/drawn_parameters.h"
#include "server/query/heights_parameters.h"
#include "server/query/streamed_parameters.h"

namespace terrace::server {
namespace {

Result<void> CheckNeedsPath(const SentTexts& texts) {
  if (!texts.contains("step") && !texts.contains("samples")) return {};
  return MakeError(ErrorCode::kInvalidArgument, "step and samples need path");
}

// Longitude and latitude of each point as 64-bit floats.
Result<HeightsQuery> ParseBinary(const ListParameters& parameters, std::string_view body, std::size_t max_locations,
                                 const std::stop_token& stop) {
  constexpr std::size_t kPointBytes = 2 * sizeof(double), kStopPeriod = 65536;
  if (!parameters.list().empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "locations and path exclude a body of points");
  }
  if (const Result<void> checked = CheckNeedsPath(parameters.texts()); !checked) return tl::unexpected(checked.error());
  if (body.empty() || body.size() % kPointBytes != 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "the body has {} bytes, which is no multiple of 16 above 0: each point is its longitude and its "
                     "latitude as little-endian 64-bit floats",
                     body.size());
  }
  const std::size_t count = body.size() / kPointBytes;
  if (count > max_locations) return TooManyPoints("the body", max_locations);
  HeightsQuery query;
  query.is_binary = true;
  query.points.reserve(count);
  ByteReader reader(body);
  for (std::size_t i = 0; i < count; ++i) {
    if (i % kStopPeriod == 0 && stop.stop_requested()) break;
    const double longitude = reader.Get<double>(), latitude = reader.Get<double>();
    // Also false for NaN.
    if (!(std::abs(longitude) <= 180) || !(std::abs(latitude) <= 90)) {
      const bool is_longitude = !(std::abs(longitude) <= 180);
      return MakeError(ErrorCode::kInvalidArgument,
                       "the body, byte {}: point {}: the {} must be a number from -{} to {}; the longitude comes first",
                       i * kPointBytes + (is_longitude ? 0 : sizeof(double)), i + 1,
                       is_longitude ? "longitude" : "latitude", is_longitude ? 180 : 90, is_longitude ? 180 : 90);
    }
    query.points.push_back({longitude, latitude});
  }
  return query;
}

Result<std::vector<dem::PathPoint>> Along(const dem::GeodesicPath& path, const SentTexts& texts,
                                          std::size_t max_locations) {
  if (const std::string* const step = TextOf(texts, "step")) {
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
  const std::string_view text = texts.at("samples");
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

Result<HeightsQuery> ParsePath(const SentTexts& texts, std::vector<dem::GeoPosition> corners, std::size_t max_locations,
                               const std::stop_token& stop) {
  if (texts.contains("step") == texts.contains("samples")) {
    return MakeError(ErrorCode::kInvalidArgument, "path needs either step (metres) or samples (how many points)");
  }
  if (corners.size() < 2) return MakeError(ErrorCode::kInvalidArgument, "path needs at least two points");
  const auto points = Along(dem::GeodesicPath(std::move(corners), stop), texts, max_locations);
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

Result<HeightsQuery> ParsePoints(const ListParameters& parameters, std::vector<dem::GeoPosition> points,
                                 std::size_t max_locations, const std::stop_token& stop) {
  if (parameters.list().empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "either locations or path is needed: latitude,longitude|...");
  }
  if (parameters.list() == "path") return ParsePath(parameters.texts(), std::move(points), max_locations, stop);
  if (const Result<void> checked = CheckNeedsPath(parameters.texts()); !checked) return tl::unexpected(checked.error());
  HeightsQuery query;
  query.points = std::move(points);
  return query;
}

Result<int> ParseCertifyLevel(std::string_view text) {
  if (text == "deepest") return geo::kMaxLevel;
  const auto level = ParseNumber<int>(text);
  if (!level || *level < 0 || *level > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument, "certify must be deepest, or a level from 0 to {}", geo::kMaxLevel);
  }
  return *level;
}

}  // namespace

Result<HeightsQuery> ParseHeights(const PointsInput& input, std::size_t max_locations, const std::stop_token& stop) {
  std::vector<dem::GeoPosition> points;
  ListParameters parameters = HeightsParameters(max_locations, input.query.size() + input.body.size(), points);
  if (const Result<void> read = ReadInput(input, stop, parameters); !read) return tl::unexpected(read.error());
  const bool is_binary = IsBinaryBody(input.content_type);
  Result<HeightsQuery> query = is_binary ? ParseBinary(parameters, input.body, max_locations, stop)
                                         : ParsePoints(parameters, std::move(points), max_locations, stop);
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the request any more");
  if (!query) return query;
  const SentTexts& texts = parameters.texts();
  if (const std::string* const certify = TextOf(texts, "certify")) {
    const Result<int> level = ParseCertifyLevel(*certify);
    if (!level) return tl::unexpected(level.error());
    query->certify_level = *level;
  }
  if (const std::string* const datum = TextOf(texts, "datum")) {
    if (const Result<void> set = SetDatum(query->datum, *datum); !set) return tl::unexpected(set.error());
  }
  if (const std::string* const normals = TextOf(texts, "normals")) {
    const Result<void> set = SetOneOf(query->wants_normals, "normals", *normals, {{"0", false}, {"1", true}});
    if (!set) return tl::unexpected(set.error());
  }
  Result<std::optional<tiler::DrawnSurface>> drawn = ParseDrawn(texts);
  if (!drawn) return tl::unexpected(drawn.error());
  query->drawn = *std::move(drawn);
  if (query->drawn && query->certify_level) {
    return MakeError(ErrorCode::kInvalidArgument, "certify is for heights of the sources, not for surface=served");
  }
  if (query->drawn && query->datum != dem::HeightDatum::kEllipsoid) {
    return MakeError(ErrorCode::kInvalidArgument, "surface=served has ellipsoidal heights alone, as tiles have");
  }
  if (query->is_binary && query->certify_level) {
    return MakeError(ErrorCode::kInvalidArgument, "certify needs a reply in JSON; send the points as JSON");
  }
  return query;
}

}  // namespace terrace::server
