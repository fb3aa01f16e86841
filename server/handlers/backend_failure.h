// The reply to a request whose work failed behind the HTTP side.
#pragma once

#include <chrono>
#include <string>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/response.h"

namespace terrace::server {

// BackendErrorResponse; a refusal for overload is held back for `refusal_delay` first.
asio::awaitable<Response> BackendFailure(Error error, std::string request_id, std::chrono::milliseconds refusal_delay);

}  // namespace terrace::server
