// The border between clients and the server as one object: who is let in, what they may ask for, and how much of it is
// under way at a time.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/connection_set.h"
#include "server/http/cors.h"
#include "server/http/edge_options.h"
#include "server/http/gate.h"
#include "server/http/tls.h"
#include "server/http/transfer_budget.h"

namespace terrace::server {

struct EdgeStats {
  std::size_t connections = 0;  // open
  std::uint64_t refused_connections = 0;
  TransferBudget::Stats transfers;
};

struct Edge {
  // Errors name the option's text, or the file.
  static Result<std::unique_ptr<Edge>> Open(const EdgeOptions& options);

  Edge(const EdgeOptions& options, GateOptions gate_options);

  EdgeStats stats() const { return {connections.size(), connections.refused(), transfers.stats()}; }

  ConnectionSet connections;
  TransferBudget transfers;
  Gate gate;
  CorsPolicy cors;
  std::unique_ptr<TlsContext> tls;  // null: plain HTTP
};

// Looks for a new certificate every two seconds, until cancelled. `tls` must outlive it.
asio::awaitable<void> WatchCertificate(TlsContext* tls);

}  // namespace terrace::server
