// GET /{dataset}/{z}/{x}/{y}.terrain, .glb and .png
#pragma once

#include <string>

#include "server/api/call.h"
#include "server/api/handler_options.h"
#include "server/asio.h"
#include "server/http/application.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

class TileHandler {
 public:
  // `tiles` must outlive this.
  TileHandler(CatalogPtr catalog, TileService& tiles, HandlerOptions options);

  // Replies that need no build (refusals and cached tiles) are returned at once. Precondition: the route has a format.
  Answer Handle(const Call& call) const;

 private:
  asio::awaitable<Response> Build(const Call& call, tiler::TileRequest tile) const;
  Response Reply(const tiler::TileRequest& tile, const ServedTile& served, const Call& call) const;

  const CatalogPtr catalog_;
  TileService& tiles_;
  const HandlerOptions options_;
};

// "cache;desc=miss, queue;dur=0.021, read;dur=1.234, ...": milliseconds of the stages of the build.
std::string FormatServerTiming(CacheStatus cache, const tiler::StageTimes& times);

}  // namespace terrace::server
