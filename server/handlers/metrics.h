// What /metrics tells, in Prometheus' text format. Thread-safe.
#pragma once

#include <memory>
#include <string>

#include "server/http/access_log.h"
#include "server/tiles/dataset_view.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

class Metrics {
 public:
  Metrics();
  ~Metrics();

  void CountReply(const ReplyRecord& record);
  void CountBuild(const DatasetView& dataset, const Result<TilePtr>& tile);

  // Everything counted so far and the state given.
  std::string Text(const TileService::Stats& tiles, const ByteCacheStats& refinements,
                   std::size_t open_connections) const;

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace terrace::server
