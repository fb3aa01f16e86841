// GET /{dataset}/mesh
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/core/result.h"
#include "server/api/call.h"
#include "server/api/handler_options.h"
#include "server/asio.h"
#include "server/http/application.h"
#include "server/http/response.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/area/area_mesh.h"

namespace terrace::server {

class AreaHandler {
 public:
  // `tiles`: its workers mesh the areas; must outlive this object.
  AreaHandler(CatalogPtr catalog, TileService& tiles, HandlerOptions options);

  Answer Handle(const Call& call) const;

 private:
  asio::awaitable<Response> Build(const Call& call, std::uint32_t dataset, tiler::AreaRequest area,
                                  tiler::AreaPlan plan, tiler::Coding coding, Response response) const;

  const CatalogPtr catalog_;
  TileService& tiles_;
  const HandlerOptions options_;
};

// Reads `bbox=west,south,east,north` and `error=METRES`, both required; `format=glb|obj|ply`,
// `coordinates=enu|ecef|geographic`; `v` may be repeated. west > east: the box crosses the antimeridian.
// kInvalidArgument: the message is for the client.
Result<tiler::AreaRequest> ParseAreaRequest(std::string_view query);

}  // namespace terrace::server
