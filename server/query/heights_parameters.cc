#include "server/query/heights_parameters.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/http/text.h"

namespace terrace::server {
namespace {

constexpr std::array<std::string_view, 2> kPointLists = {"locations", "path"};
constexpr std::array<std::string_view, 6> kHeightsTexts = {"step", "samples", "datum", "certify", "normals", "surface"};

// Messages name items by their number, because they must not quote the client's text.
Result<dem::GeoPosition> ParseLocation(std::string_view item, std::string_view name, std::size_t number) {
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

ListParameters HeightsParameters(std::size_t max_locations, std::size_t text_bytes,
                                 std::vector<dem::GeoPosition>& points) {
  const auto add = [=, &points](std::string_view name, std::size_t number, std::string_view item) -> Result<void> {
    if (points.size() == max_locations) return TooManyPoints(name, max_locations);
    const Result<dem::GeoPosition> point = ParseLocation(item, name, number);
    if (!point) return tl::unexpected(point.error());
    // A point usually takes at least 8 bytes of text, and 16 bytes of memory.
    if (points.empty()) points.reserve(std::min(max_locations, text_bytes / 8));
    points.push_back(*point);
    return {};
  };
  return {{kPointLists, kHeightsTexts, R"({"locations": "46.5,8.1|46.6,8.2"})"}, add};
}

std::optional<double> NumberOf(std::string_view text) { return FiniteNumber(Trim(text, " ")); }

tl::unexpected<Error> TooManyPoints(std::string_view parameter, std::size_t max_locations) {
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: more than {} points, which is max_locations of this server; ask for fewer at once", parameter,
                   max_locations);
}

}  // namespace terrace::server
