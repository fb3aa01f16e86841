// One connection: reads requests, has them answered in order, writes the replies.
//
// Everything of a session happens on one thread. What a client can make it hold is bounded: one read buffer of
// kMaxHeadBytes, one request with a body of at most max_body_bytes, one reply; bodies count in a budget that all
// sessions share. Where there is no room, or requests come faster than they may, the session waits; it refuses when
// the request's deadline comes.
#pragma once

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "server/asio.h"
#include "server/http/access_log.h"
#include "server/http/connection_set.h"
#include "server/http/cors.h"
#include "server/http/gate.h"
#include "server/http/request.h"
#include "server/http/request_reader.h"
#include "server/http/response.h"
#include "server/http/router.h"
#include "server/http/tls.h"
#include "server/http/transfer_budget.h"

namespace terrace::server {

struct SessionOptions {
  ReadTimeouts read;
  std::chrono::milliseconds write_timeout{
      20'000};                                   // without the client taking a single byte, and before min_rate counts
  std::size_t min_rate = 4096;                   // bytes a second that a client has to take in the long run; 0: any
  std::size_t max_body_bytes = 0;                // of a POST
  std::chrono::milliseconds refusal_delay{200};  // before a 429: who is refused at once asks again at once
  std::chrono::milliseconds drain_grace{0};      // for which a draining connection waits for one more request
};

// Answers GET, HEAD, and POST where TakesPost says so; the session leaves a HEAD's body away. Cancelled when the client
// leaves.
using Handler = std::function<asio::awaitable<Response>(Route, Request)>;

// The same for what can be answered without waiting; nothing for the rest, which the Handler is then asked.
using QuickHandler = std::function<std::optional<Response>(const Route&, const Request&)>;

// Shared by all sessions, outlives them all. What the pointers and functions refer to must outlive the sessions too.
struct SessionContext {
  SessionOptions options;
  QuickHandler quick_handler;  // may be empty
  Handler handler;
  std::function<void(const ReplyRecord&)> observer;  // after every reply; called on any io thread
  ConnectionSet* connections = nullptr;
  TransferBudget* transfers = nullptr;
  const std::atomic<std::chrono::milliseconds>* deadline = nullptr;  // of a request, since its head
  Gate* gate = nullptr;
  CorsPolicy cors;
  const TlsContext* tls = nullptr;  // null: plain HTTP
};

// Takes over an accepted socket, of an io_context that one thread runs. `client`: whom it counts for among the
// connections.
void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context,
                  const std::string& client);

}  // namespace terrace::server
