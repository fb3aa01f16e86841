// All URLs of the server, and their handlers.
#pragma once

#include <memory>

#include "server/api/handler_options.h"
#include "server/api/router.h"
#include "server/documents/document_maker.h"
#include "server/documents/static_files.h"
#include "server/handlers/area_handler.h"
#include "server/handlers/heights_handler.h"
#include "server/handlers/layer_handler.h"
#include "server/handlers/state_handler.h"
#include "server/handlers/tile_handler.h"
#include "server/handlers/tile_json_handler.h"
#include "server/handlers/tileset_handler.h"
#include "server/handlers/viewer_handler.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

// The handlers of one catalog. Thread-safe. A request keeps them alive until it is answered.
struct Handlers {
  // `tile_service` and `process` must outlive this.
  Handlers(CatalogPtr c, TileService& tile_service, std::shared_ptr<const StaticFiles> files,
           const HandlerOptions& options, const ProcessState& process);

  const CatalogPtr catalog;
  const TileHandler tiles;
  const HeightsHandler heights;
  const AreaHandler areas;
  const LayerHandler layers;
  const TilesetHandler tilesets;
  const TileJsonHandler tile_json;
  const ViewerHandler viewer;
  const StateHandler state;
  const DocumentMaker documents;
};

// The table of URLs.
const RouteTable& Routes();

}  // namespace terrace::server
