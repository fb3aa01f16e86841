#include "server/query/mesh_query.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>

#include "server/http/text.h"

namespace terrace::server {
namespace {

Result<void> SetBox(tiler::AreaRequest& area, std::string_view text) {
  const Result<dem::GeoBounds> box = ParseBox(text);
  if (!box) return tl::unexpected(box.error());
  area.west = box->west;
  area.south = box->south;
  area.east = box->east < box->west ? box->east + 360 : box->east;
  area.north = box->north;
  return {};
}

Result<void> SetError(tiler::AreaRequest& area, std::string_view text) {
  const std::optional<double> error = PositiveNumber(text);
  if (!error) return MakeError(ErrorCode::kInvalidArgument, "error must be a finite number above 0");
  area.error_m = *error;
  return {};
}

Result<void> SetMeshFormat(tiler::AreaRequest& area, std::string_view text) {
  using proto::MeshFileFormat;
  return SetOneOf(area.format, "format", text,
                  {{"glb", MeshFileFormat::kGlb}, {"obj", MeshFileFormat::kObj}, {"ply", MeshFileFormat::kPly}});
}

Result<void> SetCoordinates(tiler::AreaRequest& area, std::string_view text) {
  using tiler::AreaCoordinates;
  return SetOneOf(
      area.coordinates, "coordinates", text,
      {{"enu", AreaCoordinates::kEnu}, {"ecef", AreaCoordinates::kEcef}, {"geographic", AreaCoordinates::kGeographic}});
}

}  // namespace

Result<dem::GeoBounds> ParseBox(std::string_view text) {
  constexpr std::array<const char*, 4> kNames = {"west", "south", "east", "north"};
  std::array<double, 4> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const bool is_last = i + 1 == numbers.size();
    const std::size_t comma = is_last ? text.size() : text.find(',');
    if (comma == std::string_view::npos) {
      return MakeError(ErrorCode::kInvalidArgument, "bbox must be west,south,east,north in degrees");
    }
    const std::optional<double> number = FiniteNumber(text.substr(0, comma));
    const double most = i % 2 == 0 ? 180 : 90;
    if (!number || std::abs(*number) > most) {
      return MakeError(ErrorCode::kInvalidArgument, "bbox: {} must be a number from -{} to {}", kNames[i], most, most);
    }
    numbers[i] = *number;
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  const auto [west, south, east, north] = numbers;
  if (south >= north) return MakeError(ErrorCode::kInvalidArgument, "bbox: south must be below north");
  if (west == east || (west == 180 && east == -180)) {
    return MakeError(ErrorCode::kInvalidArgument, "bbox is empty: west and east are the same");
  }
  return dem::GeoBounds{west, south, east, north};
}

Result<tiler::AreaRequest> ParseAreaRequest(std::string_view query) {
  constexpr std::array<const char*, 4> kNames = {"bbox", "error", "format", "coordinates"};
  constexpr std::array kSet = {SetBox, SetError, SetMeshFormat, SetCoordinates};
  tiler::AreaRequest area;
  std::array<bool, kNames.size()> given{};
  const Result<void> read = ReadParameters(query, kNames, [&](std::size_t i, const std::string& value) {
    given[i] = true;
    return kSet[i](area, value);
  });
  if (!read) return tl::unexpected(read.error());
  if (!given[0] || !given[1]) {
    return MakeError(ErrorCode::kInvalidArgument, "bbox=west,south,east,north and error=METRES are needed");
  }
  return area;
}

}  // namespace terrace::server
