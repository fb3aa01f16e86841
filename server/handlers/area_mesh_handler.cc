#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "engine/core/elapsed_time.h"
#include "proto/format_error_up.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "tiler/tile/strong_etag.h"

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

Result<void> SetFormat(tiler::AreaRequest& area, std::string_view text) {
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

// The position of (0, 0, 0) of the file: latitude, longitude, metres above the ellipsoid.
std::string FormatOrigin(const dem::GeoPosition& centre) {
  const double longitude = centre.longitude > 180 ? centre.longitude - 360 : centre.longitude;
  return fmt::format("{},{},0", centre.latitude, longitude);
}

// `response`: complete except for what depends on the mesh.
asio::awaitable<Response> BuildArea(const Handlers& handlers, const RequestContext& context, std::uint32_t dataset,
                                    tiler::AreaRequest area, tiler::AreaPlan plan, tiler::Coding coding,
                                    Response response) {
  Work<tiler::EncodedTile> work = [catalog = handlers.catalog, dataset, area, plan, coding,
                                   requested_at =
                                       TileService::Clock::now()](std::stop_token stop) -> Result<tiler::EncodedTile> {
    const std::chrono::microseconds queued = MicrosecondsSince(requested_at);
    Result<tiler::EncodedTile> mesh = catalog->pipeline->BuildArea(dataset, plan, area, stop);
    if (!mesh) return mesh;
    mesh->times.queue = queued;
    if (coding == tiler::Coding::kIdentity) return mesh;
    mesh->bytes = tiler::Compress(std::move(mesh->bytes), coding, stop);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the mesh any more");
    return mesh;
  };
  const auto deadline = handlers.Deadline();
  Result<tiler::EncodedTile> mesh =
      co_await handlers.tiles.Run(std::move(work), TileService::Length::kLong, deadline, context.request->client);
  if (!mesh) co_return co_await BackendFailure(mesh.error(), context.request->id);
  response.headers.emplace_back("Terrain-Max-Error", proto::FormatErrorUp(mesh->max_error_m));
  if (area.coordinates == tiler::AreaCoordinates::kEnu) {
    response.headers.emplace_back("Terrain-Origin", FormatOrigin(plan.centre));
  }
  response.headers.emplace_back("Server-Timing", FormatServerTiming("miss", mesh->times));
  response.body = std::make_shared<const std::string>(std::move(mesh->bytes));
  co_return response;
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
  constexpr std::array kSet = {SetBox, SetError, SetFormat, SetCoordinates};
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

Answer AnswerArea(const Handlers& handlers, const RequestContext& context) {
  const Request& request = *context.request;
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, handlers.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), request.id);
  const Result<tiler::AreaRequest> area = ParseAreaRequest(context.route.query);
  if (!area) return ClientErrorResponse(area.error(), request.id);
  const Result<tiler::AreaPlan> plan = handlers.catalog->pipeline->PlanArea(*dataset, *area, handlers.max_mesh_samples);
  if (!plan) return ClientErrorResponse(plan.error(), request.id);

  const DatasetView& view = handlers.catalog->datasets[*dataset];
  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding);
  Response response;
  response.content_type = ContentTypeOf(area->format);
  response.content_encoding = tiler::NameOf(coding);
  response.etag = tiler::RequestETag("mesh", view.name, view.generation, context.route.query, coding);
  response.cache_control = CacheControlOf(context.route.query, view, handlers.cache_control);
  response.vary = "Accept-Encoding";
  if (MatchesEtag(request.fields->if_none_match, response.etag)) return Conditional(std::move(response), request);
  return BuildArea(handlers, context, *dataset, *area, *plan, coding, std::move(response));
}

}  // namespace terrace::server
