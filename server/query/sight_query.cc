#include "server/query/sight_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "engine/core/bytes.h"
#include "server/http/text.h"
#include "server/query/drawn_parameters.h"
#include "server/query/heights_parameters.h"
#include "server/query/parameters.h"
#include "server/query/points_input.h"

namespace terrace::server {
namespace {

constexpr double kLowest = -12'000, kHighest = 1'000'000;  // metres
constexpr std::size_t kPointNumbers = 3, kRayNumbers = 6;

constexpr const char* kSightNames[] = {"from",  "to",    "rays",     "heights", "refraction", "surface",
                                       "level", "error", "fraction", "atleast", "format",     "compression"};
enum Name {
  kFrom,
  kTo,
  kRays,
  kHeights,
  kRefraction,
  kSurface,
  kLevel,
  kError,
  kFraction,
  kAtLeast,
  kFormat,
  kCompression,
  kSightNameCount
};
static_assert(std::size(kSightNames) == kSightNameCount);

tl::unexpected<Error> UnknownOfSight() {
  return MakeError(ErrorCode::kInvalidArgument,
                   "unknown parameter; known are from, to, rays, heights, refraction, surface, and with surface=served "
                   "level, error, fraction, atleast, format, compression");
}

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

// Receives the parameters; parses rays one by one.
class SightParameters final : public ParameterSink {
 public:
  explicit SightParameters(std::size_t max_rays) : max_rays_(max_rays) {}

  Result<void> AddToName(std::string_view part) override {
    constexpr std::size_t kLongestSightName = 11;
    if (name_.size() + part.size() > kLongestSightName) return UnknownOfSight();
    name_ += part;
    return {};
  }
  Result<void> EndName() override {
    const std::string name = std::exchange(name_, {});
    const auto known = std::find(std::begin(kSightNames), std::end(kSightNames), name);
    current_ = static_cast<Name>(known - std::begin(kSightNames));
    if (name == "v") return {};
    if (known == std::end(kSightNames)) return UnknownOfSight();
    if (texts_[current_]) return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", *known);
    texts_[current_].emplace();
    return {};
  }
  Result<void> AddToValue(std::string_view part) override {
    if (current_ == kSightNameCount) return {};
    while (current_ == kRays) {
      const std::size_t bar = part.find('|');
      if (bar == std::string_view::npos) break;
      if (const Result<void> added = Add(part.substr(0, bar)); !added) return added;
      if (const Result<void> ended = EndRay(); !ended) return ended;
      part.remove_prefix(bar + 1);
    }
    return Add(part);
  }
  Result<void> EndValue() override { return current_ == kRays ? EndRay() : Result<void>(); }
  std::string_view JsonExample() const override { return R"({"rays": "46.5,8.1,2000,46.6,8.2,1500"})"; }

  const std::optional<std::string>& text(Name name) const { return texts_[name]; }
  std::vector<dem::SightRay> TakeRays() { return std::move(rays_); }

 private:
  Result<void> Add(std::string_view part) {
    std::string& text = *texts_[current_];
    if (text.size() + part.size() > HeightsParameters::kMaxItemBytes) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: an item is longer than {} bytes", kSightNames[current_],
                       HeightsParameters::kMaxItemBytes);
    }
    text += part;
    return {};
  }
  Result<void> EndRay() {
    if (rays_.size() == max_rays_) return TooManyRays();
    const std::string item = fmt::format("rays: item {}", rays_.size() + 1);
    const auto numbers = NumbersOf<kRayNumbers>(*texts_[kRays], " ");
    if (!numbers) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is not \"latitude,longitude,height,latitude,longitude,height\"",
                       item);
    }
    texts_[kRays]->clear();
    const dem::SightRay ray{LatitudeFirst(numbers->data()), LatitudeFirst(numbers->data() + kPointNumbers)};
    if (const Result<void> checked = Check(ray, item + ": from", item + ": to", item); !checked) return checked;
    rays_.push_back(ray);
    return {};
  }
  tl::unexpected<Error> TooManyRays() const {
    return MakeError(ErrorCode::kInvalidArgument,
                     "rays: more than {}, which is max_locations of this server; ask for fewer at once", max_rays_);
  }

  const std::size_t max_rays_;
  std::string name_;
  Name current_ = kSightNameCount;
  std::array<std::optional<std::string>, kSightNameCount> texts_;
  std::vector<dem::SightRay> rays_;
};

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
Result<std::vector<dem::SightRay>> ParseEnds(const SightParameters& parameters) {
  std::array<dem::SightPoint, 2> ends{};
  for (const Name name : {kFrom, kTo}) {
    const auto numbers = NumbersOf<kPointNumbers>(*parameters.text(name), " ");
    if (!numbers) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is not \"latitude,longitude,height\"", kSightNames[name]);
    }
    ends[name == kFrom ? 0 : 1] = LatitudeFirst(numbers->data());
  }
  const dem::SightRay ray{ends[0], ends[1]};
  if (const Result<void> checked = Check(ray, "from", "to", "the ray"); !checked)
    return tl::unexpected(checked.error());
  return std::vector<dem::SightRay>{ray};
}

Result<std::vector<dem::SightRay>> ParseRays(SightParameters& parameters, const PointsInput& input,
                                             std::size_t max_rays, const std::stop_token& stop) {
  const bool has_ends = parameters.text(kFrom) || parameters.text(kTo), has_list = parameters.text(kRays).has_value();
  if (IsBinaryBody(input.content_type)) {
    if (!has_ends && !has_list) return ParseBinaryRays(input.body, max_rays, stop);
    return MakeError(ErrorCode::kInvalidArgument, "from, to and rays exclude a body of rays");
  }
  if (has_list && !has_ends) return parameters.TakeRays();
  if (!has_list && parameters.text(kFrom) && parameters.text(kTo)) return ParseEnds(parameters);
  return MakeError(ErrorCode::kInvalidArgument,
                   "either from and to, latitude,longitude,height each, or rays=latitude,longitude,height,latitude,"
                   "longitude,height|... is needed");
}

}  // namespace

Result<SightQuery> ParseSight(const PointsInput& input, std::size_t max_rays, const std::stop_token& stop) {
  SightParameters parameters(max_rays);
  if (const Result<void> read = ReadInput(input, stop, parameters); !read) return tl::unexpected(read.error());
  SightQuery query;
  Result<std::vector<dem::SightRay>> rays = ParseRays(parameters, input, max_rays, stop);
  if (!rays) return tl::unexpected(std::move(rays).error());
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the request any more");
  query.rays = *std::move(rays);
  query.is_binary = IsBinaryBody(input.content_type);
  if (const auto& heights = parameters.text(kHeights)) {
    const auto set = SetOneOf(query.from_ground, "heights", *heights, {{"ellipsoid", false}, {"ground", true}});
    if (!set) return tl::unexpected(set.error());
  }
  if (const auto& refraction = parameters.text(kRefraction)) {
    const std::optional<double> share = NumberOf(*refraction);
    if (!share || *share < -1 || *share > 1) {
      return MakeError(ErrorCode::kInvalidArgument, "refraction must be a number from -1 to 1, such as 0.13");
    }
    query.options.refraction = *share;
  }
  Result<std::optional<tiler::DrawnSurface>> drawn = ParseDrawn(
      {parameters.text(kSurface), parameters.text(kLevel), parameters.text(kError), parameters.text(kFraction),
       parameters.text(kAtLeast), parameters.text(kFormat), parameters.text(kCompression)});
  if (!drawn) return tl::unexpected(drawn.error());
  query.drawn = *std::move(drawn);
  query.names_source = parameters.text(kSurface).has_value() && !query.drawn;
  return query;
}

}  // namespace terrace::server
