// One connection: reads requests, passes them to the application one after the other, and writes the replies.
//
// A session runs on one thread. The memory of a connection is bounded: one read buffer of kMaxHeadBytes, one request
// with a body of at most the size that its admission allows, and one reply. Bodies and replies larger than
// TransferBudget::kFreeBytes count against a budget that all sessions share. If the budget is used up, the body or the
// reply waits for memory; at the request's deadline the request is refused. An upload is refused earlier if its memory
// is given to others. A request over its client's rate waits for its turn; if the turn would come after half of the
// time to its deadline, it is refused after kRefusalDelay (http_error.h). All these waits and the answer itself share
// one deadline.
#pragma once

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

#include "server/asio/asio.h"
#include "server/http/application.h"
#include "server/http/cors.h"
#include "server/http/request_reader.h"
#include "server/net/connection_set.h"
#include "server/net/tls.h"
#include "server/net/transfer_budget.h"

namespace terrace::server {

struct SessionOptions {
  ReadTimeouts read;
  // The longest time in which the client receives no byte, and the time before min_rate applies.
  std::chrono::milliseconds write_timeout{20'000};
  std::size_t min_rate = 4096;  // average bytes per second that a client must take; 0: any
};

// Shared by all sessions, outlives them all. What the pointers refer to must outlive the sessions too.
struct SessionContext {
  SessionOptions options;
  Application* application = nullptr;
  ConnectionSet* connections = nullptr;
  TransferBudget* transfers = nullptr;
  // From the end of a request's head to Request::deadline, which a body extends by the time that it takes to arrive:
  // option request_deadline_s.
  const std::atomic<std::chrono::milliseconds>* request_time_limit = nullptr;
  CorsPolicy cors;
  const TlsContext* tls = nullptr;  // null: plain HTTP
};

// Takes over an accepted socket of an io_context that one thread runs. `client`: the client whose limit on connections
// it counts against.
void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context,
                  const std::string& client);

}  // namespace terrace::server
