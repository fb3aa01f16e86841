// What replies about points have in common: heights, grids and lines of sight.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "server/asio/asio.h"
#include "server/handlers/handlers.h"
#include "server/query/heights_query.h"

namespace terrace::server {

// The result of a job.
struct MadeReply {
  std::string bytes;  // in the reply's coding
  tiler::StageTimes times;
};

using PointHandler = asio::awaitable<Response> (*)(const HandlerState& state, const RequestContext& context,
                                                   std::uint32_t dataset);
// Calls `handler` with the index of the dataset. 415: the body's type is not supported. 404: no such dataset.
Answer AnswerPoints(const HandlerState& state, const RequestContext& context, PointHandler handler);

// kInvalidArgument: orthometric heights of a dataset whose datum is unknown.
Result<void> CheckDatum(dem::HeightDatum datum, const DatasetView& view);

// Parses query and body with ParseHeights or ParseSight, on a worker unless it is a query alone and `is_quick`.
template <typename Query>
asio::awaitable<Result<Query>> ParsePoints(const HandlerState& state, const RequestContext& context,
                                           Result<Query> (*parse)(const PointsInput& input, std::size_t max_points,
                                                                  const std::stop_token& stop),
                                           bool is_quick, JobClock::time_point deadline) {
  const Request& request = *context.request;
  const std::string& query = context.route.query;
  const bool is_post = request.method == Method::kPost;
  if (!is_post && is_quick) {
    const PointsInput input{query, {}, {}};
    co_return parse(input, state.max_locations, {});
  }
  const std::string_view type = is_post ? request.fields->content_type : std::string_view();
  Work<Query> work = [parse, query, type = std::string(type), body = request.body,
                      max_points = state.max_locations](const std::stop_token& stop) {
    return parse({query, type, body}, max_points, stop);
  };
  co_return co_await state.workers.Run(std::move(work), ShortTerms(deadline, request.client));
}

// Starts a reply with JSON, in a coding that the client accepts, or with binary values, uncompressed: they hardly
// shrink, and compressing them takes longer than reading them. Sets `no-store`, as for replies to POST.
struct PointReply {
  tiler::Coding coding;
  Response response;
};
PointReply StartPointReply(const Request& request, bool is_binary);

// The reply to a request that failed: 400, 404 (an archive has no heights), or the status of a failure of the server.
asio::awaitable<Response> FailedPointReply(Error error, const DatasetView& view, RequestId request_id);
// The reply with what a worker made, or FailedPointReply.
asio::awaitable<Response> FinishPointReply(Response response, Result<MadeReply> made, const DatasetView& view,
                                           RequestId request_id);

}  // namespace terrace::server
