// The application on the operators' address: POST /admin/purge erases tiles from all caches; GET /metrics;
// GET /version.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/http/application.h"
#include "server/jobs/worker_pool.h"
#include "server/telemetry/access_log.h"
#include "server/telemetry/metrics.h"
#include "server/telemetry/metrics_page.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/store/refinement_cache.h"

namespace terrace::server {

// What the application uses; outlives it.
struct AdminParts {
  WorkerPool& workers;
  TileService& tiles;
  tiler::RefinementCache* refinements = nullptr;  // may be null
  Metrics& metrics;
  MetricsPage& metrics_page;
  AccessLog& access_log;
  std::function<CatalogPtr()> catalog;  // the current one; never null
};

// Requests with an Origin header are refused: web pages can reach addresses of their user's machine, also loopback
// addresses.
class AdminApplication final : public Application {
 public:
  explicit AdminApplication(AdminParts parts) : parts_(std::move(parts)) {}

  std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address& peer) override;
  std::string ClientOf(const asio::ip::address& /*peer*/) const override { return {}; }

 private:
  class Handler;

  const AdminParts parts_;
};

}  // namespace terrace::server
