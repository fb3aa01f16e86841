// GET /{dataset}/{z}/{x}/{y}.terrain, .glb and .png
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "server/asio.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/http/router.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

struct TileHandlerOptions {
  std::string cache_control = "public, max-age=3600";
  std::chrono::milliseconds deadline{30'000};
  // How long a refusal for overload is held back. A client that is refused at once asks again at once, and answering
  // tens of thousands of refusals a second takes from the workers the time they need to become free.
  std::chrono::milliseconds refusal_delay{200};
};

class TileHandler {
 public:
  // `tiles` must outlive this.
  TileHandler(CatalogPtr catalog, TileService& tiles, TileHandlerOptions options);

  // What needs no build: refusals, and tiles in the cache. Nothing otherwise. Precondition: a kTile route.
  std::optional<Response> HandleNow(const Route& route, const Request& request) const;

  // Precondition: a kTile route.
  asio::awaitable<Response> Handle(Route route, Request request) const;

 private:
  Response Reply(const ServedTile& served, const tiler::TileRequest& tile, const Request& request) const;

  const CatalogPtr catalog_;
  TileService& tiles_;
  const TileHandlerOptions options_;
};

// "cache;desc=miss, queue;dur=0.021, read;dur=1.234, ...": milliseconds, the steps of the build that was waited for.
std::string FormatServerTiming(CacheStatus cache, const tiler::StageTimes& times);

}  // namespace terrace::server
