// The application behind HTTP: admits requests, passes them to their handlers, answers from the current catalog, and
// reports every reply to the log and the metrics.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/access/admission_control.h"
#include "server/access/client_limits.h"
#include "server/api/request_context.h"
#include "server/handlers/handlers.h"
#include "server/http/application.h"
#include "server/telemetry/access_log.h"
#include "server/telemetry/metrics.h"
#include "server/telemetry/metrics_page.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

// What the application uses to answer and report requests; outlives it.
struct ApplicationParts {
  ClientLimits& limits;
  WorkerPool& workers;
  TileService& tiles;
  DocumentFlights& document_flights;
  Metrics& metrics;
  MetricsPage& metrics_page;
  AccessLog& access_log;
  std::shared_ptr<const StaticFiles> viewer;
  // Called when a source is no longer the file that was opened; on io threads, must not block. Empty: nothing reopens
  // sources.
  std::function<void()> on_source_changed;
  // Returns why the folder of the statistics cache cannot be used; "" if it can. An empty function: it always can.
  std::function<std::string()> cache_problem;
  std::function<double(const std::string&)> progress_of;  // of a pending dataset, 0 to 1; may be empty
};

class TerrainApplication final : public Application, public ServerStatus {
 public:
  // Requests wait for the first Replace, except those of rows with needs_no_catalog.
  TerrainApplication(ApplicationParts parts, const config::Config& config);

  std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address& peer) override;
  std::string ClientOf(const asio::ip::address& peer) const override;

  // New requests are answered from `catalog`. Returns true if it is the first catalog.
  bool Replace(CatalogPtr catalog, const config::Config& config);

  // Problems by dataset; "" is the configuration.
  void SetProblems(std::map<std::string, std::string> problems);

  // As SessionContext::request_time_limit.
  const std::atomic<std::chrono::milliseconds>& request_time_limit() const { return request_time_limit_; }
  // Never null; without datasets until the first catalog has come.
  CatalogPtr catalog() const { return Current()->catalog; }
  bool opening() const override { return opening_.load(std::memory_order_acquire); }
  std::map<std::string, std::string> problems() const override;
  std::vector<PendingDataset> PendingOf(const Catalog& catalog) const override;
  std::uint64_t replaced() const;  // how often a catalog has replaced another

 private:
  class Handler;  // of one connection
  // What the handlers of URLs answer from; one for each catalog.
  using HandlerStatePtr = std::shared_ptr<const HandlerState>;

  bool draining() const override { return parts_.limits.connections.draining(); }
  asio::awaitable<std::shared_ptr<const std::string>> MetricsText() const override { return parts_.metrics_page.Get(); }

  HandlerStatePtr Make(CatalogPtr catalog, config::Config config) const;
  HandlerStatePtr Current() const;
  bool HasLastingProblem(const std::string& dataset) const;

  asio::awaitable<bool> FirstCatalog(JobClock::time_point give_up) const;
  asio::awaitable<bool> NextCatalog(HandlerStatePtr used, std::string dataset, JobClock::time_point give_up) const;

  const ApplicationParts parts_;
  mutable std::mutex mutex_;
  HandlerStatePtr state_;  // never null; guarded by mutex_, as the next three are
  std::uint64_t replaced_ = 0;
  std::map<std::string, std::string> problems_;
  std::map<std::string, std::chrono::steady_clock::time_point> problem_since_;  // of the same datasets
  const config::Config config_at_start_;
  std::atomic<std::chrono::milliseconds> request_time_limit_;
  std::atomic<bool> opening_{true};  // the first catalog has not come
};

}  // namespace terrace::server
