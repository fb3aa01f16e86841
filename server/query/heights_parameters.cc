#include "server/query/heights_parameters.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "server/http/text.h"

namespace terrace::server {
namespace {

constexpr const char* kTextNames[] = {"step",  "samples", "datum",    "certify", "normals", "surface",
                                      "level", "error",   "fraction", "atleast", "format",  "compression"};
static_assert(std::size(kTextNames) == HeightsParameters::kTexts);
constexpr std::size_t kLongestName = 11;

tl::unexpected<Error> Unknown() {
  return MakeError(
      ErrorCode::kInvalidArgument,
      "unknown parameter; known are locations, path, step, samples, datum, certify, normals, surface, and with "
      "surface=served level, error, fraction, atleast, format, compression");
}

tl::unexpected<Error> Repeated(const char* name) {
  return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", name);
}

// Messages name items by their number, because they must not quote the client's text.
Result<dem::GeoPosition> ParseLocation(std::string_view item, const char* name, std::size_t number) {
  const std::size_t comma = item.find(',');
  if (comma == std::string_view::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: item {} is not \"latitude,longitude\"", name, number);
  }
  const std::optional<double> latitude = NumberOf(item.substr(0, comma)), longitude = NumberOf(item.substr(comma + 1));
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

}  // namespace

std::optional<double> NumberOf(std::string_view text) { return FiniteNumber(Trim(text, " ")); }

tl::unexpected<Error> TooManyPoints(const char* parameter, std::size_t max_locations) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: more than {} points, which is max_locations of this server; ask for fewer at once", parameter,
                   max_locations);
}

Result<void> HeightsParameters::AddToName(std::string_view part) {
  if (name_.size() + part.size() > kLongestName) return Unknown();
  name_ += part;
  return {};
}

Result<void> HeightsParameters::EndName() {
  const std::string name = std::exchange(name_, {});
  if (name == "v") {
    target_ = Target::kNone;
    return {};
  }
  if (name == "locations" || name == "path") {
    const bool is_path = name == "path";
    if (points_of_ != nullptr && is_path == is_path_) return Repeated(points_of_);
    if (points_of_ != nullptr) {
      return MakeError(ErrorCode::kInvalidArgument, "either locations or path is needed, not both");
    }
    points_of_ = is_path ? "path" : "locations";
    is_path_ = is_path;
    target_ = Target::kPoints;
    // A point usually takes at least 8 bytes of text, and 16 bytes of memory.
    points_.reserve(std::min(max_locations_, text_bytes_ / 8));
    return {};
  }
  const auto known = std::find(std::begin(kTextNames), std::end(kTextNames), name);
  if (known == std::end(kTextNames)) return Unknown();
  text_ = static_cast<Text>(known - std::begin(kTextNames));
  if (texts_[text_]) return Repeated(*known);
  target_ = Target::kText;
  return {};
}

Result<void> HeightsParameters::AddToValue(std::string_view part) {
  if (target_ == Target::kNone) return {};
  if (target_ == Target::kText) return AddToItem(part);
  for (;;) {
    const std::size_t bar = part.find('|');
    if (const Result<void> added = AddToItem(part.substr(0, bar)); !added) return added;
    if (bar == std::string_view::npos) return {};
    if (const Result<void> ended = EndPoint(); !ended) return ended;
    if (points_.size() >= max_locations_) return TooManyPoints(points_of_, max_locations_);
    part.remove_prefix(bar + 1);
  }
}

Result<void> HeightsParameters::EndValue() {
  if (target_ == Target::kText) texts_[text_] = std::exchange(item_, {});
  if (target_ != Target::kPoints) return {};
  if (points_.empty() && Trim(item_, " ").empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "{} is empty", points_of_);
  }
  return EndPoint();
}

Result<void> HeightsParameters::AddToItem(std::string_view part) {
  if (item_.size() + part.size() > kMaxItemBytes) {
    if (target_ == Target::kText) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is longer than {} bytes", kTextNames[text_], kMaxItemBytes);
    }
    return MakeError(ErrorCode::kInvalidArgument, "{}: item {} is longer than {} bytes", points_of_, points_.size() + 1,
                     kMaxItemBytes);
  }
  item_ += part;
  return {};
}

Result<void> HeightsParameters::EndPoint() {
  const Result<dem::GeoPosition> point = ParseLocation(item_, points_of_, points_.size() + 1);
  if (!point) return tl::unexpected(point.error());
  item_.clear();
  points_.push_back(*point);
  return {};
}

}  // namespace terrace::server
