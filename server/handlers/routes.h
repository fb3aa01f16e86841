// Every URL and who answers it.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "server/asio.h"
#include "server/handlers/area_handler.h"
#include "server/handlers/datasets_handler.h"
#include "server/handlers/document.h"
#include "server/handlers/document_maker.h"
#include "server/handlers/heights_handler.h"
#include "server/handlers/layer_handler.h"
#include "server/handlers/metrics.h"
#include "server/handlers/static_files.h"
#include "server/handlers/tile_handler.h"
#include "server/handlers/tile_json_handler.h"
#include "server/handlers/tileset_handler.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/http/router.h"
#include "server/tiles/catalog.h"

namespace terrace::server {

// Answers from one catalog. Thread-safe.
class Routes {
 public:
  // What the probes and /metrics ask.
  struct State {
    std::function<bool()> draining;
    std::function<bool()> opening;                                 // what is served has not been opened yet
    std::function<std::map<std::string, std::string>()> troubles;  // by dataset; "" is the configuration
    std::function<asio::awaitable<std::shared_ptr<const std::string>>()> metrics_text;
  };

  // `tiles` must outlive this. `max_locations`: of one request for heights.
  Routes(CatalogPtr catalog, TileService& tiles, std::shared_ptr<const StaticFiles> viewer, TileHandlerOptions options,
         std::size_t max_locations, State state);

  // Answers what needs no waiting, which is most: all but tiles that must be built, heights, meshes, metrics, and
  // long documents with wishes in them. Nothing for those.
  std::optional<Response> ServeAtOnce(const Route& route, const Request& request) const;

  // Answers GET, HEAD, and POST where TakesPost says so. Whoever waits keeps this alive.
  asio::awaitable<Response> Serve(Route route, Request request) const;

  const Catalog& catalog() const { return *catalog_; }

 private:
  void Label(Response& response, RouteKind kind, const std::string& dataset) const;
  asio::awaitable<Response> ServeMetrics(Route route, Request request) const;
  Answer Describe(const Route& route, const Request& request) const;
  Answer DescribeViewer(const Route& route, const Request& request) const;
  using WriteDatasets = std::string (*)(std::span<const DatasetView>, const IsSeen&, const std::stop_token&);
  DocumentPlan PlanOfSeen(const Document& all, const Request& request, WriteDatasets write) const;

  const CatalogPtr catalog_;
  const TileHandler tiles_;
  const HeightsHandler heights_;
  const AreaHandler areas_;
  const LayerHandler layers_;
  const TilesetHandler tilesets_;
  const TileJsonHandler tile_json_;
  const std::shared_ptr<const StaticFiles> viewer_;
  const Document datasets_;
  const Document index_;  // for `/` without a viewer
  const DocumentMaker documents_;
  const State state_;
};

}  // namespace terrace::server
