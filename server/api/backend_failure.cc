#include "server/api/backend_failure.h"

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "server/http/http_error.h"

namespace terrace::server {

asio::awaitable<Response> BackendFailure(Error error, RequestId request_id, std::chrono::milliseconds refusal_delay) {
  if (error.code == ErrorCode::kOverloaded) {
    asio::steady_timer delay(co_await asio::this_coro::executor, refusal_delay);
    co_await delay.async_wait(asio::use_awaitable);
  }
  co_return BackendErrorResponse(error, request_id);
}

}  // namespace terrace::server
