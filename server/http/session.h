// One connection: reads requests, has them answered in order, writes the replies.
//
// Everything of a session happens on one thread. What a client can make it hold is bounded: one read buffer of
// kMaxHeadBytes, one request with a body of at most what its admission says, one reply; bodies count in a budget that
// all sessions share. Where there is no room, or requests come faster than they may, the session waits; it refuses when
// the request's deadline comes.
#pragma once

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

#include "server/asio.h"
#include "server/http/application.h"
#include "server/http/cors.h"
#include "server/http/request_reader.h"
#include "server/net/connection_set.h"
#include "server/net/tls.h"
#include "server/net/transfer_budget.h"

namespace terrace::server {

struct SessionOptions {
  ReadTimeouts read;
  std::chrono::milliseconds write_timeout{
      20'000};                                   // without the client taking a single byte, and before min_rate counts
  std::size_t min_rate = 4096;                   // bytes a second that a client has to take in the long run; 0: any
  std::chrono::milliseconds refusal_delay{200};  // before a 429: who is refused at once asks again at once
  std::chrono::milliseconds drain_grace{0};      // for which a draining connection waits for one more request
};

// Shared by all sessions, outlives them all. What the pointers refer to must outlive the sessions too.
struct SessionContext {
  SessionOptions options;
  Application* application = nullptr;
  ConnectionSet* connections = nullptr;
  TransferBudget* transfers = nullptr;
  const std::atomic<std::chrono::milliseconds>* deadline = nullptr;  // of a request, since its head
  CorsPolicy cors;
  const TlsContext* tls = nullptr;  // null: plain HTTP
};

// Takes over an accepted socket, of an io_context that one thread runs. `client`: whom it counts for among the
// connections.
void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context,
                  const std::string& client);

}  // namespace terrace::server
