#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <utility>

#include "engine/core/elapsed_time.h"
#include "proto/format_error_up.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/handlers/point_reply.h"
#include "server/http/http_error.h"
#include "server/query/mesh_query.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::server {
namespace {

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
asio::awaitable<Response> BuildArea(const HandlerState& state, const RequestContext& context, std::uint32_t dataset,
                                    tiler::AreaRequest area, tiler::AreaPlan plan, tiler::Coding coding,
                                    Response response) {
  Work<tiler::EncodedTile> work = [catalog = state.catalog, dataset, area, plan, coding,
                                   requested_at = JobClock::now()](std::stop_token stop) -> Result<tiler::EncodedTile> {
    const std::chrono::microseconds queued = MicrosecondsSince(requested_at);
    Result<tiler::EncodedTile> mesh = catalog->pipeline->BuildArea(dataset, plan, area, stop);
    if (!mesh) return mesh;
    mesh->times.queue = queued;
    if (coding == tiler::Coding::kIdentity) return mesh;
    mesh->bytes = tiler::Compress(std::move(mesh->bytes), coding, stop);
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the mesh any more");
    return mesh;
  };
  const auto deadline = context.request->deadline;
  Result<tiler::EncodedTile> mesh =
      co_await state.workers.Run(std::move(work), LongTerms(deadline, context.request->client));
  if (!mesh) co_return co_await FailedPointReply(mesh.error(), state.catalog->datasets[dataset], context.request->id);
  response.headers.emplace_back("Terrain-Max-Error", proto::FormatErrorUp(mesh->max_error_m));
  if (area.coordinates == tiler::AreaCoordinates::kEnu) {
    response.headers.emplace_back("Terrain-Origin", FormatOrigin(plan.centre));
  }
  response.headers.emplace_back("Server-Timing", FormatServerTiming("miss", mesh->times));
  response.body = std::make_shared<const std::string>(std::move(mesh->bytes));
  co_return Conditional(std::move(response), *context.request);
}

}  // namespace

Answer AnswerArea(const HandlerState& state, const RequestContext& context) {
  const Request& request = *context.request;
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), request.id);
  const Result<tiler::AreaRequest> area = ParseAreaRequest(context.route.query);
  if (!area) return ClientErrorResponse(area.error(), request.id);
  const Result<tiler::AreaPlan> plan = state.catalog->pipeline->PlanArea(*dataset, *area, state.max_mesh_samples);
  if (!plan) return ClientErrorResponse(plan.error(), request.id);

  const DatasetView& view = state.catalog->datasets[*dataset];
  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding);
  Response response;
  response.content_type = ContentTypeOf(area->format);
  response.content_encoding = tiler::NameOf(coding);
  // The version of a dataset does not cover max_mesh_samples.
  const std::string request_text = fmt::format("level {} {}", plan->level, context.route.query);
  response.etag = tiler::RequestETag("mesh", view.name, view.generation, request_text, coding);
  response.cache_control = CacheControlOf(context.route.query, view, state.cache_control, !plan->depends_on_limit);
  response.vary = "Accept-Encoding";
  if (NamesEtag(request.fields->if_none_match, response.etag)) return Conditional(std::move(response), request);
  return BuildArea(state, context, *dataset, *area, *plan, coding, std::move(response));
}

}  // namespace terrace::server
