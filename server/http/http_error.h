// Failures as clients see them: application/problem+json (RFC 9457) with fixed text and the request's id. What really
// happened goes to the log under the same id.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// The one table from kinds of failure to HTTP. Whatever is not the client's doing is 503: trying again may help.
int StatusOf(ErrorCode code);

// `detail` is sent as it is: text that the server wrote, never the path or the message of a library.
Response ProblemResponse(int status, std::string_view detail, std::string_view request_id);

// 405, naming the methods of a URL; what follows such a request may be a body of any form, so the connection closes.
Response NoSuchMethodResponse(bool takes_post, std::string_view request_id);

// For errors of Match and Negotiate, whose messages are written for clients.
Response ClientErrorResponse(const Error& error, std::string_view request_id);

// For failures behind the HTTP side: fixed text for the client, the message for the log.
Response BackendErrorResponse(const Error& error, std::string_view request_id);

}  // namespace terrace::server
