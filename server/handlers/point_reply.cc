#include "server/handlers/point_reply.h"

#include <memory>
#include <utility>

#include "server/api/tile_formats.h"
#include "server/http/http_error.h"
#include "server/query/points_input.h"

namespace terrace::server {

Answer AnswerPoints(const HandlerState& state, const RequestContext& context, PointHandler handler) {
  const Request& request = *context.request;
  if (request.method == Method::kPost && !IsPointsBody(request.fields->content_type)) {
    return ProblemResponse(415,
                           "the body's Content-Type must be application/json, application/x-www-form-urlencoded or "
                           "application/octet-stream",
                           request.id);
  }
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), request.id);
  return handler(state, context, *dataset);
}

Result<void> CheckDatum(dem::HeightDatum datum, const DatasetView& view) {
  if (datum != dem::HeightDatum::kOrthometric || view.has_datum) return {};
  return MakeError(
      ErrorCode::kInvalidArgument,
      "datum: the vertical datum of this dataset is unknown, so it has no orthometric heights; leave datum out to get "
      "the heights of the source");
}

PointReply StartPointReply(const Request& request, bool is_binary) {
  PointReply reply;
  reply.coding = is_binary ? tiler::Coding::kIdentity : NegotiateCoding(request.fields->accept_encoding);
  reply.response.content_type = is_binary ? "application/octet-stream" : "application/json";
  reply.response.content_encoding = tiler::NameOf(reply.coding);
  if (!is_binary) reply.response.vary = "Accept-Encoding";
  reply.response.cache_control = "no-store";
  return reply;
}

asio::awaitable<Response> FailedPointReply(Error error, const DatasetView& view, RequestId request_id) {
  const bool is_absent = error.code == ErrorCode::kNotFound && view.only_archive;
  if (is_absent || error.code == ErrorCode::kInvalidArgument) co_return ClientErrorResponse(error, request_id);
  co_return co_await DelayedBackendError(std::move(error), request_id);
}

asio::awaitable<Response> FinishPointReply(Response response, Result<MadeReply> made, const DatasetView& view,
                                           RequestId request_id) {
  if (!made) co_return co_await FailedPointReply(std::move(made).error(), view, request_id);
  response.body = std::make_shared<const std::string>(std::move(made->bytes));
  response.headers.emplace_back("Server-Timing", FormatServerTiming("miss", made->times));
  co_return response;
}

}  // namespace terrace::server
