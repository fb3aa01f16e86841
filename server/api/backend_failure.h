// The reply to a request that failed after admission, in the work behind HTTP.
#pragma once

#include <chrono>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// BackendErrorResponse; a refusal for overload is delayed by `refusal_delay`.
asio::awaitable<Response> BackendFailure(Error error, RequestId request_id, std::chrono::milliseconds refusal_delay);

}  // namespace terrace::server
