// The header lines of a reply that describe its tile: written once, and kept with the tile.
#pragma once

#include <string>

#include "tiler/encoded_tile.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// Content-Type, Content-Encoding and Content-Length; ETag, Terrain-Max-Error and Terrain-Certified-Error. `tile` is
// what answers `request`.
tiler::HeadLines MakeTileHead(const tiler::TileRequest& request, const tiler::EncodedTile& tile);

}  // namespace terrace::server
