// What a reply's head says of the tile in its body: written once, and kept with the tile.
#pragma once

#include <string>

#include "server/tiles/encoded_tile.h"
#include "server/tiles/tile_request.h"

namespace terrace::server {

// Content-Type, Content-Encoding and Content-Length; ETag, Terrain-Max-Error and Terrain-Certified-Error. `tile` is
// what answers `request`.
HeadLines MakeTileHead(const TileRequest& request, const EncodedTile& tile);

}  // namespace terrace::server
