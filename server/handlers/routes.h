// Every URL and who answers it.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/asio.h"
#include "server/handlers/area_handler.h"
#include "server/handlers/document.h"
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

namespace terrace::server {

// Thread-safe: immutable after construction.
class Routes {
 public:
  // What the probes and /metrics ask.
  struct State {
    std::function<bool()> draining;
    std::function<std::string()> metrics_text;
  };
  struct Heights {
    PointReader read;
    std::size_t max_locations = 0;
  };

  // `datasets` and `tiles` must outlive this.
  Routes(std::span<const DatasetView> datasets, TileService& tiles, StaticFiles viewer, TileHandlerOptions options,
         Heights heights, AreaMesher mesher, State state);

  // Answers what needs no waiting, which is most: all but tiles that must be built, heights and meshes. Nothing for
  // those.
  std::optional<Response> ServeAtOnce(const Route& route, const Request& request) const;

  // Answers GET, HEAD, and POST where TakesPost says so.
  asio::awaitable<Response> Serve(Route route, Request request) const;

 private:
  Response ServeNow(const Route& route, const Request& request) const;
  Response ServeViewer(const Route& route, const Request& request) const;
  std::vector<DatasetView> SeenBy(const Request& request) const;

  const std::span<const DatasetView> views_;
  const TileHandler tiles_;
  const HeightsHandler heights_;
  const AreaHandler areas_;
  const LayerHandler layers_;
  const TilesetHandler tilesets_;
  const TileJsonHandler tile_json_;
  const StaticFiles viewer_;
  const Document datasets_;
  const Document index_;  // for `/` without a viewer
  const State state_;
};

}  // namespace terrace::server
