// The metrics of /metrics, in Prometheus' text format. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/net/transfer_budget.h"
#include "server/telemetry/access_log.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

class Metrics {
 public:
  Metrics();
  ~Metrics();

  void CountReply(const ReplyRecord& record);
  void CountBuild(const DatasetView& dataset, const Result<tiler::TilePtr>& tile);

  // Removes the counters of all other datasets, because datasets may be added and removed as long as the server runs. A
  // reply that began earlier may still count for a removed dataset, until the next call.
  void RetainDatasets(const std::vector<DatasetView>& datasets);

  struct ServerState {
    TileService::Stats tiles;
    std::size_t queued = 0;         // jobs that wait for a worker
    std::size_t in_flight = 0;      // tiles, documents and other work that requests wait for
    std::uint64_t joined = 0;       // requests that waited for the work of another request
    tiler::CacheStats refinements;  // in memory
    // The tiers below memory: the first `tile_stores` hold tiles, the others refinements.
    std::vector<tiler::StoreBase*> stores;
    std::size_t tile_stores = 0;
    std::size_t connections = 0;  // open
    std::uint64_t refused_connections = 0;
    TransferBudget::Stats transfers;
    CatalogPtr catalog;  // never null
    std::size_t problems = 0;
    std::uint64_t catalogs = 0;  // how often one has replaced another
  };
  // Returns the text of all counters and of the given state.
  std::string Text(const ServerState& state) const;

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace terrace::server
