// The application on the operators' address: POST /admin/purge erases tiles from all caches; GET /metrics;
// GET /version.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "server/http/application.h"
#include "server/jobs/worker_pool.h"
#include "server/telemetry/access_log.h"
#include "server/telemetry/metrics.h"
#include "server/telemetry/metrics_page.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/store/refinement_cache.h"
#include "tiler/store/tile_selection.h"

namespace terrace::server {

// `dataset=NAME`, and optionally `bbox=west,south,east,north` and `levels=8` or `levels=8-13`. kNotFound: `catalog` has
// no such dataset. kInvalidArgument: the query is wrong. Messages are for the client.
struct Purge {
  std::string dataset, version;
  tiler::TileSelection selection;
};
Result<Purge> ParsePurge(std::string_view query, const Catalog& catalog);

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
