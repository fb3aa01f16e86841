// The metrics of /metrics, in Prometheus' text format. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/net/transfer_budget.h"
#include "server/store/disk_cache.h"
#include "server/telemetry/access_log.h"
#include "server/tiles/dataset_view.h"
#include "server/tiles/tile_service.h"

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
    std::size_t connections = 0;  // open
    std::uint64_t refused_connections = 0;
    TransferBudget::Stats transfers;
    std::size_t datasets = 0, troubles = 0;
    std::vector<std::pair<std::string, std::string>> versions = {};  // name and version of each dataset
    std::uint64_t catalogs = 0;                                      // replaced so far
    std::optional<DiskCacheStats> disk = {};                         // nothing: no disk cache
  };
  // Returns the text of all counters and of the given state.
  std::string Text(const TileService::Stats& tiles, const tiler::ByteCacheStats& refinements,
                   const SourceStats& sources, const ServerState& state) const;

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace terrace::server
