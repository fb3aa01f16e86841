// Errors in the form that clients see: application/problem+json (RFC 9457) with a fixed text and the request's id. The
// actual cause is logged under the same id.
#pragma once

#include <chrono>
#include <string_view>

#include "engine/core/result.h"
#include "server/asio/asio.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// Maps kinds of error to HTTP status. Errors that the client did not cause are 503: a retry may succeed.
int StatusOf(ErrorCode code);

// `detail` is sent verbatim. It is text that the server wrote, never a path or a library's message.
Response ProblemResponse(int status, std::string_view detail, std::string_view request_id);

// 503 of a server that has no room now.
Response OverloadedResponse(std::string_view detail, std::string_view request_id);

// 405 with the methods of the URL. Closes the connection: the refused request may be followed by a body of any form.
Response NoSuchMethodResponse(bool takes_post, std::string_view request_id);

// For errors of routing and negotiation, whose messages are written for clients.
Response ClientErrorResponse(const Error& error, std::string_view request_id);

// For failures behind the HTTP side: fixed text for the client, the message for the log.
Response BackendErrorResponse(const Error& error, std::string_view request_id);

// Delay of a refusal for overload or for a client's rate. A client that is refused at once retries at once, and
// answering tens of thousands of refusals a second would take time from the workers.
inline constexpr std::chrono::milliseconds kRefusalDelay{200};

// BackendErrorResponse; a refusal for overload is delayed.
asio::awaitable<Response> DelayedBackendError(Error error, RequestId request_id);

}  // namespace terrace::server
