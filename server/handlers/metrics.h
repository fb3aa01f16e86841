// What /metrics tells, in Prometheus' text format. Thread-safe.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "server/http/access_log.h"
#include "server/http/edge.h"
#include "server/tiles/dataset_view.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

class Metrics {
 public:
  explicit Metrics(std::span<const DatasetView> datasets);
  ~Metrics();

  void CountReply(const ReplyRecord& record);
  void CountBuild(const TileRequest& request, const Result<TilePtr>& tile);

  // Everything counted so far and the state given.
  std::string Text(const TileService::Stats& tiles, const ByteCacheStats& refinements, const EdgeStats& edge) const;

 private:
  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace terrace::server
