// The texture of a GLB tile.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/gltf/glb_tile.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// Cuts the texture of the requested tile from the imagery and adds it to `options`. Does nothing if no texture is
// requested or the image shows no part of the tile. kUnavailable: the image cannot be read now. kCancelled: stopped.
Result<void> AddTexture(const ImageryRules& imagery, const TileRequest& request, proto::GlbOptions& options,
                        const std::stop_token& stop);

}  // namespace terrace::tiler
