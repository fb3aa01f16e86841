#include "server/query/sight_query.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "engine/core/bytes.h"
#include "server/http/text.h"
#include "server/query/drawn_parameters.h"
#include "server/query/list_parameters.h"
#include "server/query/points_input.h"
#include "server/query/streamed_parameters.h"

namespace terrace::server {
namespace {

constexpr double kLowest = -12'000, kHighest = 1'000'000;  // metres
constexpr std::size_t kPointNumbers = 3, kRayNumbers = 6;

constexpr std::array<std::string_view, 1> kRayLists = {"rays"};
constexpr std::array<std::string_view, 5> kSightTexts = {"from", "to", "heights", "refraction", "surface"};

// Also refuses NaN. `what`: names the end in messages.
Result<void> CheckPoint(const dem::SightPoint& point, const std::string& what) {
  const auto is_within = [](double value, double most) { return std::abs(value) <= most; };
  if (!is_within(point.latitude, 90)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the latitude must be a number from -90 to 90", what);
  }
  if (!is_within(point.longitude, 180)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the longitude must be a number from -180 to 180", what);
  }
  if (!(point.height_m >= kLowest && point.height_m <= kHighest)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: the height must be a number from {} to {} m", what, kLowest,
                     kHighest);
  }
  return {};
}

Result<void> Check(const dem::SightRay& ray, const std::string& from, const std::string& to, const std::string& whole) {
  if (const Result<void> checked = CheckPoint(ray.from, from); !checked) return checked;
  if (const Result<void> checked = CheckPoint(ray.to, to); !checked) return checked;
  const double length_m = dem::LengthOf(ray);
  if (length_m > dem::kMaxSightLength) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: {:.0f} km long, the most is {:.0f} km", whole, length_m / 1000,
                     dem::kMaxSightLength / 1000);
  }
  return {};
}

dem::SightPoint LatitudeFirst(const double* numbers) { return {numbers[1], numbers[0], numbers[2]}; }
dem::SightPoint LongitudeFirst(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

ListParameters SightParameters(std::size_t max_rays, std::vector<dem::SightRay>& rays) {
  const auto add = [max_rays, &rays](std::string_view, std::size_t number, std::string_view item) -> Result<void> {
    if (rays.size() == max_rays) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "rays: more than {}, which is max_locations of this server; ask for fewer at once", max_rays);
    }
    const std::string place = fmt::format("rays: item {}", number);
    const auto numbers = NumbersOf<kRayNumbers>(item, " ");
    if (!numbers) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is not \"latitude,longitude,height,latitude,longitude,height\"",
                       place);
    }
    const dem::SightRay ray{LatitudeFirst(numbers->data()), LatitudeFirst(numbers->data() + kPointNumbers)};
    if (const Result<void> checked = Check(ray, place + ": from", place + ": to", place); !checked) return checked;
    rays.push_back(ray);
    return {};
  };
  return {{kRayLists, kSightTexts, R"({"rays": "46.5,8.1,2000,46.6,8.2,1500"})"}, add};
}

Result<std::vector<dem::SightRay>> ParseBinaryRays(std::string_view body, std::size_t max_rays,
                                                   const std::stop_token& stop) {
  constexpr std::size_t kRayBytes = kRayNumbers * sizeof(double), kStopPeriod = 4096;
  if (body.empty() || body.size() % kRayBytes != 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "the body has {} bytes, which is no multiple of 48 above 0: each ray is longitude, latitude and "
                     "height of its two ends as little-endian 64-bit floats",
                     body.size());
  }
  if (body.size() / kRayBytes > max_rays) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "the body: more than {} rays, which is max_locations of this server; ask for fewer at once",
                     max_rays);
  }
  std::vector<dem::SightRay> rays;
  ByteReader reader(body);
  while (reader.remaining() > 0) {
    if (rays.size() % kStopPeriod == 0 && stop.stop_requested()) break;
    std::array<double, kRayNumbers> numbers{};
    for (double& number : numbers) number = reader.Get<double>();
    const dem::SightRay ray{LongitudeFirst(numbers.data()), LongitudeFirst(numbers.data() + kPointNumbers)};
    const Result<void> checked = Check(ray, "from", "to", "the ray");
    if (!checked) {
      return MakeError(ErrorCode::kInvalidArgument, "the body, byte {}: ray {}: {}", rays.size() * kRayBytes,
                       rays.size() + 1, checked.error().message);
    }
    rays.push_back(ray);
  }
  return rays;
}

// The one ray of `from` and `to`.
Result<std::vector<dem::SightRay>> ParseEnds(const SentTexts& texts) {
  dem::SightRay ray;
  for (const auto& [name, end] : {std::pair("from", &ray.from), std::pair("to", &ray.to)}) {
    const auto numbers = NumbersOf<kPointNumbers>(texts.at(name), " ");
    if (!numbers) return MakeError(ErrorCode::kInvalidArgument, "{} is not \"latitude,longitude,height\"", name);
    *end = LatitudeFirst(numbers->data());
  }
  if (const Result<void> checked = Check(ray, "from", "to", "the ray"); !checked)
    return tl::unexpected(checked.error());
  return std::vector<dem::SightRay>{ray};
}

// `listed`: the rays of `rays`.
Result<std::vector<dem::SightRay>> ParseRays(const ListParameters& parameters, std::vector<dem::SightRay> listed,
                                             const PointsInput& input, std::size_t max_rays,
                                             const std::stop_token& stop) {
  const bool has_from = parameters.texts().contains("from"), has_to = parameters.texts().contains("to");
  const bool has_ends = has_from || has_to, has_list = !parameters.list().empty();
  if (IsBinaryBody(input.content_type)) {
    if (!has_ends && !has_list) return ParseBinaryRays(input.body, max_rays, stop);
    return MakeError(ErrorCode::kInvalidArgument, "from, to and rays exclude a body of rays");
  }
  if (has_list && !has_ends) return listed;
  if (!has_list && has_from && has_to) return ParseEnds(parameters.texts());
  return MakeError(ErrorCode::kInvalidArgument,
                   "either from and to, latitude,longitude,height each, or rays=latitude,longitude,height,latitude,"
                   "longitude,height|... is needed");
}

}  // namespace

Result<SightQuery> ParseSight(const PointsInput& input, std::size_t max_rays, const std::stop_token& stop) {
  std::vector<dem::SightRay> listed;
  ListParameters parameters = SightParameters(max_rays, listed);
  if (const Result<void> read = ReadInput(input, stop, parameters); !read) return tl::unexpected(read.error());
  SightQuery query;
  Result<std::vector<dem::SightRay>> rays = ParseRays(parameters, std::move(listed), input, max_rays, stop);
  if (!rays) return tl::unexpected(std::move(rays).error());
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the request any more");
  query.rays = *std::move(rays);
  query.is_binary = IsBinaryBody(input.content_type);
  const SentTexts& texts = parameters.texts();
  if (const std::string* const heights = TextOf(texts, "heights")) {
    const auto set = SetOneOf(query.from_ground, "heights", *heights, {{"ellipsoid", false}, {"ground", true}});
    if (!set) return tl::unexpected(set.error());
  }
  if (const std::string* const refraction = TextOf(texts, "refraction")) {
    const std::optional<double> share = FiniteNumber(Trim(*refraction, " "));
    if (!share || *share < -1 || *share > 1) {
      return MakeError(ErrorCode::kInvalidArgument, "refraction must be a number from -1 to 1, such as 0.13");
    }
    query.options.refraction = *share;
  }
  Result<std::optional<tiler::DrawnSurface>> drawn = ParseDrawn(texts);
  if (!drawn) return tl::unexpected(drawn.error());
  query.drawn = *std::move(drawn);
  query.names_source = texts.contains("surface") && !query.drawn;
  return query;
}

}  // namespace terrace::server
