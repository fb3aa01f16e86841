// HandlerState of fake datasets, and the replies of document handlers, with documents made in the calling thread.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "tests/server/test_context.h"

namespace terrace::server {

class TestHandlerState : private ServerStatus {
 public:
  explicit TestHandlerState(CatalogPtr catalog)
      : all(std::move(catalog), workers_, tiles_, document_flights_, std::make_shared<const StaticFiles>(),
            Configured(), *this) {}
  explicit TestHandlerState(std::vector<DatasetView> datasets)
      : TestHandlerState(std::make_shared<const Catalog>(Catalog{std::move(datasets), nullptr})) {}

 private:
  static config::Config Configured() {
    config::Config config;
    config.cache_control = "max-age=1";
    config.trusted_proxies = {"127.0.0.1"};
    config.forwarded_header = config::ForwardedHeader::kForwarded;
    return config;
  }
  bool draining() const override { return false; }
  bool opening() const override { return false; }
  std::map<std::string, std::string> problems() const override { return {}; }
  std::vector<PendingDataset> PendingOf(const Catalog&) const override { return {}; }
  asio::awaitable<std::shared_ptr<const std::string>> MetricsText() const override { co_return nullptr; }

  WorkerPool workers_{1, 100};
  TileService tiles_{workers_};
  DocumentFlights document_flights_{workers_};

 public:
  const HandlerState all;
};

inline Response AtOnce(DocumentAnswer described, const Request& request) {
  const auto* plan = std::get_if<DocumentPlan>(&described);
  if (plan == nullptr) return std::get<Response>(std::move(described));
  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly);
  return Serve(*MakeDocument(plan->write, coding, {}), *plan, request);
}

}  // namespace terrace::server
