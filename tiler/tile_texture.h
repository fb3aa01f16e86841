// The texture of a GLB tile.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/gltf/glb_tile.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// Cuts the picture of the tile that `request` asks for out of the imagery and puts it into `options`; nothing where
// none is wanted or the image shows no part of the tile. kUnavailable: the image cannot be read now. kCancelled:
// stopped.
Result<void> AddTexture(const ImageryRules& imagery, const TileRequest& request, proto::GlbOptions& options,
                        const std::stop_token& stop);

}  // namespace terrace::tiler
