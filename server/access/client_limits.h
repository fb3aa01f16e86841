// The server's limits towards clients as one object: who is admitted, what they may request, and how many connections
// and bytes may be in use at a time.
#pragma once

#include <memory>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/access/admission_control.h"
#include "server/asio/asio.h"
#include "server/http/cors.h"
#include "server/net/connection_set.h"
#include "server/net/tls.h"
#include "server/net/transfer_budget.h"

namespace terrace::server {

struct ClientLimits {
  // Errors quote the option's value, or name the file.
  static Result<std::unique_ptr<ClientLimits>> Open(const config::Config& config);

  ClientLimits(const config::Config& config, AdmissionOptions admission);

  ConnectionSet connections;
  TransferBudget transfers;
  AdmissionControl admission_control;
  CorsPolicy cors;
  std::unique_ptr<TlsContext> tls;  // null: plain HTTP
};

// Looks for a new certificate every two seconds, until cancelled. `tls` must outlive it.
asio::awaitable<void> WatchCertificate(TlsContext* tls);

}  // namespace terrace::server
