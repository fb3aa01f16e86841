#include "server/handlers/area_handler.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "proto/error_text.h"
#include "server/handlers/backend_failure.h"
#include "server/http/http_error.h"
#include "server/http/negotiate.h"
#include "server/http/query.h"
#include "server/http/text.h"
#include "server/tiles/tile_head.h"
#include "tiler/strong_etag.h"

namespace terrace::server {
namespace {

Result<void> SetBox(tiler::AreaRequest& area, std::string_view text) {
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
  area.west = west;
  area.south = south;
  area.east = east < west ? east + 360 : east;
  area.north = north;
  if (area.west == area.east) {  // 180 and -180 are the same as well
    return MakeError(ErrorCode::kInvalidArgument, "bbox is empty: west and east are the same");
  }
  return {};
}

Result<void> SetError(tiler::AreaRequest& area, std::string_view text) {
  const std::optional<double> error = PositiveNumber(text);
  if (!error) return MakeError(ErrorCode::kInvalidArgument, "error must be a finite number above 0");
  area.error_m = *error;
  return {};
}

Result<void> SetFormat(tiler::AreaRequest& area, std::string_view text) {
  using proto::MeshFileFormat;
  for (const auto& [name, format] : {std::pair("glb", MeshFileFormat::kGlb), std::pair("obj", MeshFileFormat::kObj),
                                     std::pair("ply", MeshFileFormat::kPly)}) {
    if (text != name) continue;
    area.format = format;
    return {};
  }
  return MakeError(ErrorCode::kInvalidArgument, "format must be glb, obj or ply");
}

Result<void> SetCoordinates(tiler::AreaRequest& area, std::string_view text) {
  for (const auto& [name, coordinates] :
       {std::pair("enu", tiler::AreaCoordinates::kEnu), std::pair("ecef", tiler::AreaCoordinates::kEcef),
        std::pair("geographic", tiler::AreaCoordinates::kGeographic)}) {
    if (text != name) continue;
    area.coordinates = coordinates;
    return {};
  }
  return MakeError(ErrorCode::kInvalidArgument, "coordinates must be enu, ecef or geographic");
}

std::string_view ContentTypeOf(proto::MeshFileFormat format) {
  switch (format) {
    case proto::MeshFileFormat::kGlb:
      return "model/gltf-binary";
    case proto::MeshFileFormat::kObj:
      return "model/obj";
    case proto::MeshFileFormat::kPly:
      break;
  }
  return "application/octet-stream";
}

// Where (0, 0, 0) of the file lies: latitude, longitude, metres above the ellipsoid.
std::string FormatOrigin(const dem::GeoPosition& centre) {
  const double longitude = centre.longitude > 180 ? centre.longitude - 360 : centre.longitude;
  return fmt::format("{},{},0", centre.latitude, longitude);
}

}  // namespace

Result<tiler::AreaRequest> ParseAreaRequest(std::string_view query) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  using Set = Result<void> (*)(tiler::AreaRequest&, std::string_view);
  constexpr std::array<std::pair<const char*, Set>, 4> kKnown = {
      {{"bbox", SetBox}, {"error", SetError}, {"format", SetFormat}, {"coordinates", SetCoordinates}}};
  tiler::AreaRequest area;
  std::array<bool, kKnown.size()> given{};
  for (const auto& [name, value] : *sent) {
    if (name == "v") continue;
    std::size_t i = 0;
    while (i < kKnown.size() && name != kKnown[i].first) ++i;
    if (i == kKnown.size()) {
      return MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are bbox, error, format, coordinates");
    }
    if (std::exchange(given[i], true)) {
      return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", kKnown[i].first);
    }
    if (const Result<void> set = kKnown[i].second(area, value); !set) return tl::unexpected(set.error());
  }
  if (!given[0] || !given[1]) {
    return MakeError(ErrorCode::kInvalidArgument, "bbox=west,south,east,north and error=METRES are needed");
  }
  return area;
}

AreaHandler::AreaHandler(CatalogPtr catalog, TileService& tiles, TileHandlerOptions options)
    : catalog_(std::move(catalog)), tiles_(tiles), options_(std::move(options)) {}

asio::awaitable<Response> AreaHandler::Handle(Route route, Request request) const {
  const Result<std::uint32_t> dataset = FindDataset(route.dataset, catalog_->datasets);
  if (!dataset) co_return ClientErrorResponse(dataset.error(), request.id);
  const Result<tiler::AreaRequest> area = ParseAreaRequest(route.query);
  if (!area) co_return ClientErrorResponse(area.error(), request.id);
  const Result<tiler::AreaPlan> plan = catalog_->area_mesher.plan(*dataset, *area);
  if (!plan) co_return ClientErrorResponse(plan.error(), request.id);

  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding);
  Response response;
  response.content_type = ContentTypeOf(area->format);
  response.coding = coding;
  response.etag = tiler::RequestETag("mesh", catalog_->datasets[*dataset].name, catalog_->datasets[*dataset].generation,
                                     route.query, coding);
  response.cache_control = options_.cache_control;
  response.vary = true;
  if (MatchesEtag(request.fields->if_none_match, response.etag)) co_return Conditional(std::move(response), request);

  SingleFlight::Work work = [catalog = catalog_, index = *dataset, area = *area, plan = *plan,
                             coding](std::stop_token stop) -> Result<tiler::EncodedTile> {
    Result<tiler::EncodedTile> mesh = catalog->area_mesher.build(index, plan, area, stop);
    if (!mesh || coding == tiler::Coding::kIdentity) return mesh;
    mesh->bytes = tiler::Compress(std::move(mesh->bytes), coding, stop);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the mesh any more");
    return mesh;
  };
  const auto deadline = TileService::Clock::now() + options_.deadline;
  const Result<tiler::TilePtr> mesh =
      co_await tiles_.Run(std::move(work), TileService::Length::kLong, deadline, request.client);
  if (!mesh) co_return co_await BackendFailure(mesh.error(), std::string(request.id), options_.refusal_delay);
  response.body = Body(*mesh, &(*mesh)->bytes);
  response.headers.emplace_back("Terrain-Max-Error", proto::FormatErrorUp((*mesh)->max_error_m));
  if (area->coordinates == tiler::AreaCoordinates::kEnu) {
    response.headers.emplace_back("Terrain-Origin", FormatOrigin(plan->centre));
  }
  response.headers.emplace_back("Server-Timing", FormatServerTiming(CacheStatus::kMiss, (*mesh)->times));
  co_return response;
}

}  // namespace terrace::server
