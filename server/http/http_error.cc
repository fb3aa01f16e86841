#include "server/http/http_error.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <iterator>
#include <string>

#include "server/http/status_text.h"

namespace terrace::server {
namespace {

std::string_view FixedDetail(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNotFound:
      return "no such tile";
    case ErrorCode::kUnavailable:
      return "the source cannot be read now";
    case ErrorCode::kChanged:
      return "the source is being replaced";
    case ErrorCode::kOverloaded:
      return "too much is being built";
    case ErrorCode::kCancelled:
      return "the answer was not ready in time";
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kInternal:
      break;
  }
  return "the answer cannot be built now";
}

// Seconds. A full queue drains quickly, and a replaced source is reopened soon; a source that cannot be read usually
// has to be repaired.
const char* RetryAfter(ErrorCode code) {
  return code == ErrorCode::kOverloaded || code == ErrorCode::kChanged ? "1" : "5";
}

// Escapes a string for JSON. Does not use the JSON library, which asserts if memory is exhausted, because this case
// must be reported, too.
std::string EscapedForJson(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      escaped += '\\';
      escaped += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      fmt::format_to(std::back_inserter(escaped), "\\u{:04x}", static_cast<unsigned char>(c));
    } else {
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace

int StatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 400;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kUnavailable:
    case ErrorCode::kChanged:
    case ErrorCode::kOverloaded:
    case ErrorCode::kCancelled:
    case ErrorCode::kInternal:
      break;
  }
  return 503;
}

Response ProblemResponse(int status, std::string_view detail, std::string_view request_id) {
  Response response;
  response.status = status;
  response.content_type = "application/problem+json";
  response.body = std::make_shared<const std::string>(
      fmt::format(R"({{"type":"about:blank","title":"{}","status":{},"detail":"{}","request_id":"{}"}})",
                  TextOfStatus(status).title, status, EscapedForJson(detail), request_id));
  response.cache_control = "no-store";
  return response;
}

Response NoSuchMethodResponse(bool takes_post, std::string_view request_id) {
  const std::string methods = MethodsOf(takes_post);
  const std::string detail = fmt::format("only {} are answered here", methods);
  Response response = ProblemResponse(405, detail, request_id);
  response.headers.emplace_back("Allow", methods);
  response.close = true;
  return response;
}

Response OverloadedResponse(std::string_view detail, std::string_view request_id) {
  Response response = ProblemResponse(503, detail, request_id);
  response.headers.emplace_back("Retry-After", "1");
  return response;
}

Response ClientErrorResponse(const Error& error, std::string_view request_id) {
  return ProblemResponse(StatusOf(error.code), error.message, request_id);
}

Response BackendErrorResponse(const Error& error, std::string_view request_id) {
  // Refusals under load, and requests for a dataset whose source was replaced, are too many for the log; the access log
  // has them.
  const bool is_usual = error.code == ErrorCode::kOverloaded || error.code == ErrorCode::kChanged;
  const auto level = is_usual ? spdlog::level::debug : spdlog::level::warn;
  spdlog::log(level, "request {} failed ({}): {}", request_id, ToString(error.code), error.message);
  // The request has passed every check, so this is an error of the server.
  const ErrorCode code = error.code == ErrorCode::kInvalidArgument ? ErrorCode::kInternal : error.code;
  const int status = StatusOf(code);
  Response response = ProblemResponse(status, FixedDetail(code), request_id);
  if (status == 503) response.headers.emplace_back("Retry-After", RetryAfter(error.code));
  response.try_again = code == ErrorCode::kChanged;
  response.labels.error = ToString(code);
  return response;
}

asio::awaitable<Response> DelayedBackendError(Error error, RequestId request_id) {
  if (error.code == ErrorCode::kOverloaded) {
    asio::steady_timer delay(co_await asio::this_coro::executor, kRefusalDelay);
    co_await delay.async_wait(asio::use_awaitable);
  }
  co_return BackendErrorResponse(error, request_id);
}

}  // namespace terrace::server
