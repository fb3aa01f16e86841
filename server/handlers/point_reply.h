// What replies about points have in common: heights, grids and lines of sight.
#pragma once

#include <cstdint>
#include <string>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "server/asio.h"
#include "server/handlers/handlers.h"

namespace terrace::server {

// The result of a job.
struct MadeReply {
  std::string bytes;  // in the reply's coding
  tiler::StageTimes times;
};

using PointHandler = asio::awaitable<Response> (*)(const Handlers& from, const RequestContext& context,
                                                   std::uint32_t dataset);
// Calls `handler` with the index of the dataset. 415: the body's type is not supported. 404: no such dataset.
Answer AnswerPoints(const Handlers& from, const RequestContext& context, PointHandler handler);

// kInvalidArgument: orthometric heights of a dataset whose datum is unknown.
Result<void> CheckDatum(dem::HeightDatum datum, const DatasetView& view);

// Starts a reply with JSON, in a coding that the client accepts, or with binary values, uncompressed: they hardly
// shrink, and compressing them takes longer than reading them. Sets `no-store`, as for replies to POST.
struct PointReply {
  tiler::Coding coding;
  Response response;
};
PointReply StartPointReply(const Request& request, bool is_binary);

// The reply to a request that failed: 400, 404 (an archive has no heights), or the status of a failure of the server.
asio::awaitable<Response> RefusePoints(Error error, const DatasetView& view, RequestId request_id);
// The reply with what a worker made, or RefusePoints.
asio::awaitable<Response> FinishPointReply(Response response, Result<MadeReply> made, const DatasetView& view,
                                           RequestId request_id);

}  // namespace terrace::server
