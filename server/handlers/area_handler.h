// GET /{dataset}/mesh
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/handlers/tile_handler.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/http/router.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/area/area_mesh.h"

namespace terrace::server {

class AreaHandler {
 public:
  // `tiles`, whose workers mesh the areas, must outlive this.
  AreaHandler(CatalogPtr catalog, TileService& tiles, TileHandlerOptions options);

  // Precondition: a kMesh route.
  asio::awaitable<Response> Handle(Route route, Request request) const;

 private:
  const CatalogPtr catalog_;
  TileService& tiles_;
  const TileHandlerOptions options_;
};

// `bbox=west,south,east,north` and `error=METRES`, both needed; `format=glb|obj|ply`,
// `coordinates=enu|ecef|geographic`; `v` may come any number of times. west > east is a box across the antimeridian.
// kInvalidArgument, with a message for the client.
Result<tiler::AreaRequest> ParseAreaRequest(std::string_view query);

}  // namespace terrace::server
