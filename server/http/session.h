// One connection: reads requests, has them answered in order, writes the replies.
//
// Everything of a session happens on one thread. What a client can make it hold is bounded: one read buffer of
// kMaxHeadBytes, one request with a body of at most max_body_bytes, one reply.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "server/asio.h"
#include "server/http/access_log.h"
#include "server/http/connection_set.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

struct SessionOptions {
  std::chrono::milliseconds header_timeout{5'000};  // from a request's first byte to its empty line; again for its body
  std::chrono::milliseconds idle_timeout{30'000};   // between a reply and the next request
  std::chrono::milliseconds write_timeout{20'000};  // without the client taking a single byte
  std::size_t max_body_bytes = 0;                   // of a POST
};

// Answers GET, HEAD, and POST where TakesPost says so; the session leaves a HEAD's body away. Cancelled when the client
// leaves.
using Handler = std::function<asio::awaitable<Response>(Request)>;

// The same for what can be answered without waiting; nothing for the rest, which the Handler is then asked.
using QuickHandler = std::function<std::optional<Response>(const Request&)>;

// Shared by all sessions, outlives them all. `connections` and what the functions refer to must outlive the sessions
// too.
struct SessionContext {
  SessionOptions options;
  QuickHandler quick_handler;  // may be empty
  Handler handler;
  std::function<void(const ReplyRecord&)> observer;  // after every reply; called on any io thread
  ConnectionSet* connections = nullptr;
};

// Takes over an accepted socket, of an io_context that one thread runs.
void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context);

}  // namespace terrace::server
