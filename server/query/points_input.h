// The parameters of a request for points or rays: those of its URL, and those of its body. Pure.
#pragma once

#include <stop_token>
#include <string_view>

#include "engine/core/result.h"
#include "server/query/streamed_parameters.h"

namespace terrace::server {

// The parts of a request that contain parameters.
struct PointsInput {
  std::string_view query;         // of the URL
  std::string_view content_type;  // of the body; IsPointsBody is true for it; empty: no body
  std::string_view body;
};

// Whether bodies of this Content-Type are supported: a JSON object of texts and numbers, a form, or points as numbers:
// application/octet-stream, longitude and latitude of each point as little-endian 64-bit floats.
bool IsPointsBody(std::string_view content_type);
bool IsBinaryBody(std::string_view content_type);

// Passes the parameters of the query and of the body, unless it is binary, to a sink. Errors: those of the readers
// (streamed_parameters.h) and of the sink; those of the body name its byte.
Result<void> ReadInput(const PointsInput& input, const std::stop_token& stop, ParameterSink& parameters);

}  // namespace terrace::server
