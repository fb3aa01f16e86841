// What /metrics tells, in Prometheus' text format. Thread-safe.
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

  // Forgets what was counted of other datasets: names come and go for as long as the server runs. A reply that began
  // before may still count for one that is gone, until the next call.
  void RetainDatasets(const std::vector<DatasetView>& datasets);

  struct ServerState {
    std::size_t connections = 0;  // open
    std::uint64_t refused_connections = 0;
    TransferBudget::Stats transfers;
    std::size_t datasets = 0, troubles = 0;
    std::vector<std::pair<std::string, std::string>> versions = {};  // name and version of each dataset
    std::uint64_t catalogs = 0;                                      // that have replaced one another
    std::optional<DiskCacheStats> disk = {};                         // nothing: there is none
  };
  // Everything counted so far and the state given.
  std::string Text(const TileService::Stats& tiles, const tiler::ByteCacheStats& refinements,
                   const SourceStats& sources, const ServerState& state) const;

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace terrace::server
